"""The sections of one drive: its rates, the filter, regions, stages, thresholds, or masks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.data.words import DASH, defined, listing, number, percent, points
from roadeval.evaluation import score
from roadeval.evaluation.metrics import FULL, SHORT, SHORT_OVERLAP
from roadeval.evaluation.regions import partitions, titles
from roadeval.evaluation.score import BINS, FILTER, merged
from roadeval.evaluation.stats import Difference
from roadeval.report.blocks import (
    Block,
    Cell,
    Figure,
    Heading,
    ImageGrid,
    KeepTogether,
    Table,
    Text,
)
from roadeval.report.charts import standard as charts
from roadeval.report.charts.standard import (
    CURVES_CAPTION,
    coverage,
    curves,
    difference,
    figures_over_drive,
)
from roadeval.report.findings import Findings, FleetFindings, PairedComparison
from roadeval.report.images import variants_of
from roadeval.report.sections.common import (
    SIDE_BY_SIDE,
    example_pictures,
    rate_cells,
    sampled_frames,
    variant_cell,
)
from roadeval.results.facts import Totals
from roadeval.results.sentences import CLAIMED, correction, marked_interval

PAPER_WINDOW: Final = 10
"""Frames in a row of the paper's figures (over_drive 5)."""
RATES: Final = 4
"""Rates that share a table where the variants are side by side."""
NO_NUMBERS: Final = (
    "The paper's text gives no number for its figures 3a and 3b, and their curves are lost, so "
    "nothing can be held against it number by number. Its claims can be checked."
)


def over_drive(findings: Findings) -> Iterator[Block]:
    """Yield the rates over the drive as the paper shows them."""
    yield Heading("Over the drive: the paper's tables and figures")
    if len(findings.windows):
        yield from _rates_tables(findings)
    if findings.examples:
        pictures = list(example_pictures(findings.examples))
        yield ImageGrid(pictures, len(variants_of(findings.examples)) + 2)
        yield Text("The paper's figure 2: input and output images, and the truth.", "note")
    for figure in figures_over_drive():
        if charts := figure.charts(findings.windows):
            yield Figure(charts, figure.caption)
    yield from _claims(findings)


def _claims(findings: Findings) -> Iterator[Block]:
    """Tabulate in how many windows the paper's claims are borne out."""
    found = findings.facts.claims
    short = any(each["short"] for each in found.values())
    rows = [
        [
            words,
            f"{each['held']} of {each['windows']}",
            *([f"{each['short_held']} of {each['short']}"] if short else []),
        ]
        for name, words in CLAIMED.items()
        if (each := found.get(name))
    ]
    if not rows:
        return
    table = Table(
        ["claim", "borne out by", *(["shorter, at the end"] if short else [])],
        rows,
        caption=f"Windows of {findings.facts.evaluation.window} frames that bear it out, of those "
        "in which both rates are defined. Equal rates do not.",
    )
    yield KeepTogether([Heading("What the paper claims", 2), Text(NO_NUMBERS), table])


def _rates_tables(findings: Findings) -> Iterator[Block]:
    """Tabulate the windows; several tables where the variants do not fit side by side."""
    together = RATES if len(findings.finals) <= SIDE_BY_SIDE else 1
    names = [*FULL]
    for place in range(0, len(names), together):
        yield _rates_table(findings, names[place : place + together])
    size = findings.window_size
    long = "" if size == PAPER_WINDOW else f" The paper's rows are of {PAPER_WINDOW}."
    rest = score.each_window(findings.windows)["frames"][-1]
    short = f" The last row holds {rest}." if rest < size else ""
    yield Text(
        f"Rows of {size} evaluated frames: the mean of the frames' rates in percent.{long}{short} "
        "The last line is the mean over all evaluated frames.",
        "note",
    )


def _rates_table(findings: Findings, rates: Sequence[str]) -> Table:
    windows, names = findings.windows, [*findings.finals]
    masks = zip(*(windows[each] for each in ("variant", "stage", "window")), strict=True)
    places = {mask: place for place, mask in enumerate(masks)}

    def cell(name: str, window: int, rate: str) -> str:
        place = places.get((name, findings.finals[name], window))
        return percent(None if place is None else float(windows[rate][place]))

    each = score.each_window(windows)
    spans = (each[name].tolist() for name in ("window", "first_frame", "last_frame"))
    rows: list[list[Cell | str]] = [
        [
            _span(first, last),
            *(cell(name, number, rate) for rate in rates for name in names),
        ]
        for number, first, last in zip(*spans, strict=True)
    ]
    whole = [percent(findings.total(name).get(rate)) for rate in rates for name in names]
    rows.append([Cell(text, bold=True) for text in ("all", *whole)])
    return Table(
        ["frames", *(name for _ in rates for name in names)],
        rows,
        breaks=[len(rows) - 1],
        groups=[("", 1), *((f"{rate}, %", len(names)) for rate in rates)],
        small=True,
    )


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}{DASH}{last}"


def filter_effect(findings: Findings) -> Iterator[Block]:
    """Yield what the filter changed, how much masks flicker, and who beats the baseline."""
    filters = [each for each in findings.paired if each.control != BASELINE]
    blind = [each for each in findings.paired if each.control == BASELINE]
    for each in filters:
        yield Heading("Filtered against unfiltered")
        yield from _paired(findings, each)
    if blind:
        yield Heading("Against a guess that never looks at the image", 2 if filters else 1)
        yield _against_baseline(findings, blind)
        yield Text(
            f"{BASELINE}: the training frames' mean truth, thresholded at one half. A variant that "
            "does not beat it has learnt nothing from the pixels. Differences are the variant "
            "minus the guess, with intervals that allow for neighbouring frames' likeness.",
            "note",
        )
    if legend := correction(pair.differences["ERR"] for pair in findings.paired):
        yield Text(legend, "note")
    yield from _flicker(findings)


def _paired(findings: Findings, pair: PairedComparison) -> Iterator[Block]:
    yield _differences(findings, pair)
    change = pair.differences["ERR"]
    if not defined(change.mean):
        yield Text("ERR is undefined on every frame, so the effect of the filter on it is unknown.")
        return
    yield Text(_method(change), "note")
    yield Text(frames_changed(pair))
    if pair.pixels is not None:
        yield Text(pixels_changed(findings, pair))
    columns = pair.frames["frame"], pair.frames["ERR"]
    yield Figure(
        [difference(*columns, pair.treated, pair.control, change)],
        f"ERR of {pair.treated} minus {pair.control}, frame by frame.",
    )


def _differences(findings: Findings, pair: PairedComparison) -> Table:
    names = [pair.treated, pair.control]
    return Table(
        ["rate", *names, "difference, pp", "interval, pp", "frames", "effective"],
        [
            [
                rate,
                *(percent(findings.total(name)[rate]) for name in names),
                Cell(points(change.mean), bold=True),
                marked_interval(change),
                number(change.units),
                DASH if change.effective is None else f"{change.effective:.0f}",
            ]
            for rate, change in pair.differences.items()
        ],
        caption=(
            f"Paired differences of the final masks, {pair.treated} minus {pair.control}: percent, "
            "and percentage points with their interval."
        ),
    )


def _method(change: Difference) -> str:
    if change.low is None:
        return f"No interval for ERR: {change.none_because}."
    return (
        f"{percent(change.confidence, 0)} % intervals. Neighbouring frames resemble each other, "
        "and the intervals are the wider for it; effective is the number of independent frames "
        "that would say as much. All of this is about this drive only."
    )


def frames_changed(pair: PairedComparison) -> str:
    """Return on how many frames the filter lowers ERR, raises it and leaves it."""
    better, same, worse = (int((np.sign(pair.frames["ERR"]) == sign).sum()) for sign in (-1, 0, 1))
    count = max(better + same + worse, 1)
    parts = [
        f"lowers ERR on {better} frames ({percent(better / count, 0)} %)",
        f"raises it on {worse} ({percent(worse / count, 0)} %)",
        *([f"leaves it on {same} ({percent(same / count, 0)} %)"] if same else []),
    ]
    return f"Of {better + same + worse} frames the filter {listing(parts)}."


def pixels_changed(findings: Findings, pair: PairedComparison) -> str:
    """Return which share of the pixels the filter made right and wrong, and what remains."""
    assert pair.pixels is not None
    right, wrong, labelled = pair.pixels
    net = int(pair.frames["wrong"].sum())
    change = f"{number(abs(net))} {'more' if net > 0 else 'fewer'} wrong pixels in all"
    return (
        f"Of the labelled pixels of {sampled_frames(findings)}, {percent(right / labelled)} % are "
        f"newly right with the filter and {percent(wrong / labelled)} % newly wrong; over all "
        f"frames that leaves {change}."
    )


def _flicker(findings: Findings) -> Iterator[Block]:
    """Tabulate how much of each final mask changes from frame to frame, beside the truth's own."""
    known = {name: each for name, each in findings.facts.beyond.items() if defined(each["flicker"])}
    if not known:
        return
    yield Heading("From one frame to the next", 2)
    yield Table(
        ["final mask", "flicker, %", "the truth's own, %", "beyond it, pp", "pairs of frames"],
        [
            [
                variant_cell(name, [*findings.finals]),
                Cell(percent(each["flicker"]), bold=True),
                percent(each["truth_flicker"]),
                points(each["flicker"] - each["truth_flicker"]),
                number(each["pairs"]),
            ]
            for name, each in known.items()
        ],
    )
    yield Text(
        "Flicker: the share of pixels, labelled in both of two frames read one after the other, "
        "whose mask differs. What moves must change, as the truth does; only what goes beyond it "
        "is unrest. Motion is not taken out.",
        "note",
    )


def _against_baseline(findings: Findings, blind: Sequence[PairedComparison]) -> Table:
    return Table(
        ["final mask", "ERR", "difference, pp", "interval, pp", "frames better", "frames worse"],
        [
            [
                variant_cell(pair.treated, [*findings.finals]),
                percent(findings.total(pair.treated)["ERR"]),
                Cell(points((change := pair.differences["ERR"]).mean), bold=True),
                marked_interval(change),
                number(int((pair.frames["ERR"] < 0).sum())),
                number(int((pair.frames["ERR"] > 0).sum())),
            ]
            for pair in blind
        ],
    )


SHARES: Final = {"ERR": "ERR within, %", "errors": "share of its wrong pixels, %"}
"""Columns of `Findings.regions` that are tabulated for each variant, with their titles."""


def regions(findings: Findings | FleetFindings) -> Iterator[Block]:
    """Yield in which parts of the image the errors are, of a drive or of many together."""
    if not findings.regions:
        return
    yield Heading("Where the errors are")
    names = titles([*dict.fromkeys(region for region, _ in findings.regions)], findings.height)
    yield Figure(
        charts.regions(findings.regions, [*findings.finals], names),
        "Error rate within each region, and the region's share of all wrong pixels beside its "
        "share of all pixels: a mark to the right of the grey bar is more than its share.",
    )
    together = len(findings.finals) <= SIDE_BY_SIDE
    for columns in [[*SHARES]] if together else [[column] for column in SHARES]:
        yield regions_table(findings, names, {column: SHARES[column] for column in columns})
    yield Text(_regions_note(findings, names), "note")
    if isinstance(findings, Findings) and findings.heatmaps:
        yield Figure(
            [*charts.heat(findings.heatmaps)],
            f"Where the final masks go wrong, over {sampled_frames(findings)}. FP: non-road called "
            "road; FN: road missed. Percent of the frames that label the pixel; grey: none does.",
        )


def regions_table(
    findings: Findings | FleetFindings, names: Mapping[str, str], columns: Mapping[str, str]
) -> Table:
    """Tabulate the regions with their share of the pixels, and some columns for each variant.

    Parameters
    ----------
    findings
        Of the drive.
    names
        The regions' titles.
    columns
        Some of `SHARES`.
    """
    variants = [*findings.finals]
    found, order = findings.regions, [*names]
    return Table(
        ["region", "of all, %", *(name for _ in columns for name in variants)],
        [
            [
                title,
                percent(found[region, variants[0]]["pixels"], 1),
                *(percent(found[region, v][column], 1) for column in columns for v in variants),
            ]
            for region, title in names.items()
        ],
        # A rule above each family of regions that is the whole frame cut in another way.
        breaks=sorted({order.index(family[0]) for family in partitions(order)} - {0}),
        groups=[
            ("", 1),
            ("pixels", 1),
            *((title, len(variants)) for title in columns.values()),
        ],
        small=True,
    )


def _regions_note(findings: Findings | FleetFindings, names: Mapping[str, str]) -> str:
    width = findings.facts.run.get("evaluation", {}).get("boundary_width")
    near = f"within {width} pixels of" if width else "near"
    shadow = (
        "Shadow is what the filter took for shadow, right or wrong; where it is not true shadow, "
        "that is a finding of its own. "
    )
    return (
        f"{shadow if 'shadow' in names else ''}"
        f"Near the road's edge means {near} the border between road "
        "and non-road in the truth. Counts of all evaluated frames together; regions overlap."
    )


def stages(findings: Findings) -> Iterator[Block]:
    """Yield what each stage did to the mask, and which part of the error is whose."""
    yield Heading("Which stage broke it")
    yield Figure(
        charts.stages(findings.totals),
        f"Rates of each stage's mask, means over the frames; {BASELINE}, which has no stages, for "
        "scale.",
    )
    yield stages_table(findings)
    if findings.changes:
        yield Text(
            "Repaired and spoiled: labelled pixels that the stage has right and the mask before it "
            f"wrong, and the reverse, over {sampled_frames(findings)}.",
            "note",
        )
    yield Heading("How the error of the final mask comes about", 2)
    yield _parts_table(findings)
    yield Text(_parts_note(findings), "note")
    yield from _oracles(findings)


def stages_table(findings: Findings) -> Table:
    """Tabulate the rates of every stage, and the pixels that it repaired and spoiled."""
    rows: list[list[Cell | str]] = []
    breaks = []
    for variant, stages in findings.totals.items():
        breaks.append(len(rows))
        for place, (stage, total) in enumerate(stages.items()):
            repaired, spoiled = findings.changes.get((variant, stage), (None, None))
            rows.append(
                [
                    variant_cell(variant, [*findings.totals]) if place == 0 else "",
                    stage,
                    *rate_cells(total, bold=stage == findings.finals[variant]),
                    *(percent(findings.overlap[variant][stage][name]) for name in SHORT_OVERLAP),
                    percent(repaired),
                    percent(spoiled),
                ]
            )
    meanings = "; ".join(f"{name}: {metric.in_words}" for name, metric in SHORT.items())
    return Table(
        ["variant", "stage", *SHORT, *SHORT_OVERLAP, "repaired", "spoiled"],
        rows,
        text_columns=(0, 1),
        breaks=breaks[1:],
        caption=f"Percent. {meanings}.",
    )


def _parts_table(findings: Findings) -> Table:
    """Tabulate the mean ERR of each final mask as a sum over its stages."""
    columns = merged(findings.error_parts.values())
    return Table(
        ["final mask", *columns, "ERR"],
        [
            [
                variant_cell(variant, [*findings.totals]),
                *(_part(parts, part) for part in columns),
                Cell(percent(findings.total(variant)["ERR"]), bold=True),
            ]
            for variant, parts in findings.error_parts.items()
        ],
    )


def _part(parts: Mapping[str, float], part: str) -> str:
    if part not in parts:
        return DASH
    first = part == next(iter(parts))
    return percent(parts[part]) if first else points(parts[part])


def _parts_note(findings: Findings) -> str:
    first, *rest = max(findings.error_parts.values(), key=len)
    meanings = "".join(f"; {part}: {_meaning(part)}" for part in rest)
    return (
        f"A sum, in percent of the pixels. {first}: the error of the mask that the last stage is "
        f"given, without the filter{meanings}. Percentage points add up to ERR."
    )


def _meaning(part: str) -> str:
    if part == FILTER:
        return f"what {FILTERED} has more or less than {UNFILTERED} in that mask"
    return f"what {part} made of it"


def _oracles(findings: Findings) -> Iterator[Block]:
    """Yield what remains when a stage is replaced by the truth, where the run counted that."""
    if not findings.oracles:
        return
    yield Heading("If a stage were perfect", 2)
    yield Table(
        [
            *("variant", "if there were a", "ERR as it is", "ERR then", "change, pp"),
            *(*(f"{name} then" for name in SHORT if name != "ERR"), "frames"),
        ],
        [
            [
                variant_cell(row["variant"], [*findings.totals]),
                f"perfect {row['oracle']}",
                percent(row["as_is"]),
                Cell(percent(row["ERR"]), bold=True),
                points(row["ERR"] - row["as_is"]),
                *(percent(row[name]) for name in SHORT if name != "ERR"),
                number(row["frames"]),
            ]
            for row in findings.oracles
        ],
        text_columns=(0, 1),
        small=True,
    )
    yield Text(
        "Oracles: the stage's output replaced by the truth while replaying, and the stages after "
        "it run on that; ignored pixels count as non-road, or lit. No result, but a bound on "
        "what mending the stage could bring, and what the stages after it lose by themselves.",
        "note",
    )


def thresholds(findings: Findings) -> Iterator[Block]:
    """Yield the curves and what is quoted of them; nothing without a probability."""
    quoted = findings.facts.curves
    charts = curves(findings.levels, quoted, findings.totals)
    if not quoted or not charts:
        return
    yield Heading("Over thresholds")
    yield Figure(charts, CURVES_CAPTION)
    yield _thresholds_table(findings, quoted)
    yield Text(
        "All labelled pixels of the evaluated frames together. F is the harmonic mean of precision "
        "and recall; MaxF the greatest over all thresholds, and a threshold that was chosen on the "
        "drive that it is judged on flatters. AP: the mean precision over the steps of recall, "
        "without interpolation. AUC: the area under the ROC, the chance that a road pixel has a "
        "higher probability than another one. ECE: how far the share of road in each of "
        f"{BINS} equal bins of the probability is from the mean probability there, on average over "
        "the pixels; 0 if probabilities are what they say.",
        "note",
    )


def _thresholds_table(findings: Findings, quoted: Totals) -> Table:
    """Tabulate areas, MaxF and calibration beside the rates of the mask as it is."""
    rows: list[list[Cell | str]] = []
    for variant, stages in quoted.items():
        for stage, own in stages.items():
            mask = findings.overlap[variant][stage]
            total = findings.totals[variant][stage]
            rows.append(
                [
                    variant_cell(variant, [*findings.totals]),
                    stage,
                    number(own["frames"]),
                    *(percent(own[name]) for name in ("AP", "AUC", "ECE")),
                    Cell(percent(own["MaxF"]), bold=True),
                    *(percent(own[name]) for name in ("threshold", "precision", "recall")),
                    *(percent(mask[name]) for name in ("F1", "precision")),
                    percent(total["pooled_TPR"]),
                ]
            )
    return Table(
        [
            *("variant", "stage", "frames", "AP", "AUC", "ECE", "MaxF", "threshold"),
            *("precision", "recall", "F1", "precision", "recall"),
        ],
        rows,
        text_columns=(0, 1),
        groups=[
            *(("", 3), ("over all thresholds", 3)),
            *(("at the best threshold", 4), ("the mask as it is", 3)),
        ],
        caption="Percent.",
        small=True,
    )


def masks(findings: Findings) -> Iterator[Block]:
    """Yield what there is to see without truth."""
    yield Heading("Masks")
    yield Text(
        "Without truth nothing can be said about errors: not whether the road was found, not "
        "whether the filter helps, not which stage is at fault. What follows is what was computed."
    )
    if findings.examples:
        pictures = list(example_pictures(findings.examples))
        yield ImageGrid(pictures, len(variants_of(findings.examples)) + 1)
    if findings.coverage:
        yield Figure(
            [coverage(findings.coverage)],
            "The share of the image that the final masks call road. A jump is worth a look.",
        )
