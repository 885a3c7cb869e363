"""The sections of one drive: its rates, the filter, regions, stages, thresholds, or masks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from roadeval.data import BASELINE, FILTERED, UNFILTERED, colours
from roadeval.data.arrays import Floats
from roadeval.data.words import DASH, defined, number, percent, points
from roadeval.evaluation import tables
from roadeval.evaluation.metres import ABOVE
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.regions import titles
from roadeval.evaluation.score.scoreboard import Effect
from roadeval.evaluation.tables import merged, only, perfect_stages
from roadeval.report.blocks import Block, Cell, Details, Figure, Heading, ImageGrid, Table, Text
from roadeval.report.charts import standard as charts
from roadeval.report.charts.standard import figures_over_drive
from roadeval.report.findings import Findings
from roadeval.report.images import example_grid, heat_map
from roadeval.report.tables import (
    OTHERS,
    differences_table,
    stages_table,
    thresholds_table,
    variant_cell,
)
from roadeval.results.fleet import FleetFolder
from roadeval.results.sentences import CLAIMED, correction


def over_drive(findings: Findings) -> Iterator[Block]:
    """Yield the rates over the drive as the paper shows them."""
    told = [*_claims(findings)]
    if findings.examples:
        caption = "The paper's figure 2: input and output images, and the truth."
        told.append(example_grid(findings.examples, caption))
    told += [
        Figure(charts, figure.caption)
        for figure in figures_over_drive()
        if (charts := figure.charts(findings.windows))
    ]
    if told:
        yield Heading("Over the drive")
        yield Details("The paper's claims, and its figures 2, 3a and 3b", told)


def _claims(findings: Findings) -> Iterator[Block]:
    """Tabulate in how many windows the paper's claims are borne out."""
    claims = findings.facts.claims
    rows = [
        [words, f"{claims[name]['held']} of {claims[name]['windows']}"]
        for name, words in CLAIMED.items()
        if name in claims
    ]
    if rows:
        yield Table(
            ["claim", "borne out by"],
            rows,
            caption=f"Windows of {findings.facts.evaluation.window} frames that bear a claim out, "
            "of those in which both rates are defined; windows.csv has their rates.",
        )


def filter_effect(findings: Findings) -> Iterator[Block]:
    """Yield what the filter and each variant change, and how much masks flicker."""
    effects = findings.facts.final_effects
    if effects:
        yield Heading("What the filter and the variants change")
        yield differences_table(findings.facts)
        yield Text(_method(effects), "note")
    pairs = tables.changes(findings.table("frames"), FILTERED, UNFILTERED)
    of_filter = (each for each in effects if (each.variant, each.base) == (FILTERED, UNFILTERED))
    change = next((each.rates[TESTED] for each in of_filter if len(pairs)), None)
    if change and not defined(change.mean):
        yield Text("ERR is undefined on every frame, so what the filter does to it is unknown.")
    elif change:
        steps = only(findings.table("changes"), from_variant=UNFILTERED, to_variant=FILTERED)
        for row in steps[steps["N"] > 0].to_dict("records"):  # none of a killed run
            yield Text(pixels_changed(row, int(pairs["wrong"].sum())))
        drawn = charts.difference(pairs, FILTERED, UNFILTERED, change)
        caption = f"ERR of {FILTERED} minus {UNFILTERED}, frame by frame; below 0 the filter helps."
        yield Figure([drawn], caption)
    yield from _over_time(findings)


def _method(effects: Sequence[Effect]) -> str:
    changes = [each.rates[TESTED] for each in effects]
    told = [
        f"Final masks. {BASELINE}: a guess that never looks at the image, the training frames' "
        "mean truth thresholded at one half."
    ]
    if known := [change for change in changes if change.low is not None]:
        told.append(
            f"{percent(known[0].confidence, 0)} % intervals, of this drive only, allow for "
            "neighbouring frames that resemble each other; effective: the number of independent "
            "frames that would say as much."
        )
    why = dict.fromkeys(change.none_because for change in changes if change.low is None)
    told += [f"No interval for ERR: {reason}." for reason in why if reason]
    return " ".join(filter(None, [*told, correction(changes)]))


def pixels_changed(step: Mapping[Any, Any], net: int) -> str:
    """Return which share of the pixels the filter made right and wrong, and what remains.

    ``step`` is its row of ``changes``, ``net`` the change of wrong pixels, frame by frame.
    """
    right, wrong = (percent(step[name] / step["N"]) for name in ("repaired", "spoiled"))
    change = f"{number(abs(net))} {'more' if net > 0 else 'fewer'} wrong pixels in all"
    return (
        f"Of the labelled pixels of all evaluated frames, {right} % are newly right with the "
        f"filter and {wrong} % newly wrong; over all frames that leaves {change}."
    )


def _over_time(findings: Findings) -> Iterator[Block]:
    """Tabulate how much each final mask changes, beside the truth's own, and how long it errs."""
    beyond = findings.facts.beyond.items()
    known = {name: own | own["episodes"] for name, own in beyond if "episodes" in own}
    if not known:
        return
    lines: list[list[Cell | str]] = []
    for name, own in known.items():
        flicker = own["flicker"]
        lines.append(
            [
                variant_cell(name, [*findings.finals]),
                Cell(percent(flicker), bold=True),
                percent(own["truth_flicker"]),
                points(flicker - own["truth_flicker"]) if defined(flicker) else DASH,
                *(number(own[count]) for count in ("pairs", "episodes")),
                *(f"{own[time]:.1f}" for time in ("seconds", "longest")),
                percent(own["share"]),
                number(own["recovered"]),
                f"{own['recovery']:.1f}" if own["recovered"] else DASH,
            ]
        )
    table = Table(
        [
            *("final mask", "flicker, %", "the truth's, %", "beyond it, pp", "pairs"),
            *("n", "seconds", "longest", "share, %", "recovered", "median recovery"),
        ],
        lines,
        groups=[("", 1), ("from frame to frame", 4), ("error episodes, seconds", 6)],
        small=True,
    )
    meaning = Text(
        "Flicker: the share of pixels, labelled in both of two frames read one after the other, "
        "whose mask differs. What moves must change, as the truth does; only what goes beyond it "
        "is unrest. Error episode: from a frame with an ERR of at least "
        f"{percent(next(iter(known.values()))['limit'], 0)} % to the first one below, by header "
        "stamps; one that the drive's end or a gap between frames cuts off has not recovered.",
        "note",
    )
    yield Details("From one frame to the next", [table, meaning])


def regions(findings: Findings | FleetFolder) -> Iterator[Block]:
    """Yield in which parts of the image the errors are, of a drive or of many together."""
    if findings.regions.empty:
        return
    yield Heading("Where the errors are")
    # What counts cells of ground has no share of the pixels.
    found = findings.regions.index.unique("region").drop(ABOVE, errors="ignore")
    names = titles([*found], findings.height)
    yield Figure(
        charts.regions(findings.regions, [*findings.finals], names),
        "Error rate within each region, and the region's share of all wrong pixels beside its "
        "share of all pixels: a mark to the right of the grey bar is more than its share.",
    )
    shadow = "Shadow is what the filter took for shadow, right or wrong. " * ("shadow" in names)
    note = (
        f"{shadow}Near the road's edge: within "
        f"{findings.facts.evaluation.boundary_width} pixels of the border between road and "
        "non-road in the truth. Regions overlap; regions.csv has their counts."
    )
    yield Text(note, "note")
    if not isinstance(findings, Findings):
        return
    beyond = findings.facts.beyond.items()
    if near := {name: own["trimap"] for name, own in beyond if "trimap" in own}:
        yield Figure(
            [charts.trimap(near)],
            "Trimap: ERR of the final masks within 1 to 32 pixels of the true edge of the road, of "
            "all frames together. The steeper a curve falls, the closer to the edge errors lie.",
        )
    if findings.heatmaps:
        yield _heat_maps(findings.heatmaps)


def stages(findings: Findings) -> Iterator[Block]:
    """Yield what each stage did to the mask, and which part of the error is whose."""
    yield Heading("Which stage broke it")
    yield Figure(
        charts.stages(findings.totals),
        f"Rates of each stage's mask, means over the frames; {BASELINE}, which has no stages, for "
        "scale.",
    )
    yield _parts_table(findings)
    both = {FILTERED, UNFILTERED} <= findings.totals.keys()
    of_filter = f" what {FILTERED} has more or less than {UNFILTERED} in it;" if both else ""
    note = (
        "How ERR comes about, in percent of the pixels: the mask that the last stage is given, "
        f"without the filter;{of_filter} and what the last stage makes of it."
    )
    yield Text(note, "note")
    numbers: list[Block] = [stages_table(findings.totals, findings.changes)]
    if findings.changes:
        note = (
            "Repaired and spoiled: labelled pixels that the stage has right and the mask before it "
            "wrong, and the reverse, over all evaluated frames."
        )
        numbers.append(Text(note, "note"))
    yield Details("Every stage in numbers", numbers)
    yield from _oracles(findings)


def _parts_table(findings: Findings) -> Table:
    """Tabulate the mean ERR of each final mask as a sum over its stages."""
    columns = merged(findings.error_parts.values())
    return Table(
        ["final mask", *columns, TESTED],
        [
            [
                variant_cell(variant, [*findings.totals]),
                *((points if p in [*parts][1:] else percent)(parts.get(p)) for p in columns),
                Cell(percent(findings.total(variant)[TESTED]), bold=True),
            ]
            for variant, parts in findings.error_parts.items()
        ],
    )


def _oracles(findings: Findings) -> Iterator[Block]:
    """Yield what remains when a stage is replaced by the truth, where the run counted that."""
    rows = [*perfect_stages(findings.table("oracles"), findings.table("frames"))]
    if not rows:
        return
    table = Table(
        [
            *("variant", "if there were a", "ERR as it is", "ERR then", "change, pp"),
            *(*(f"{name} then" for name in OTHERS), "frames"),
        ],
        [
            [
                variant_cell(row["variant"], [*findings.totals]),
                f"perfect {row['oracle']}",
                percent(row["as_is"]),
                Cell(percent(row[TESTED]), bold=True),
                points(row[TESTED] - row["as_is"]),
                *(percent(row[name]) for name in OTHERS),
                number(row["frames"]),
            ]
            for row in rows
        ],
        text_columns=(0, 1),
        small=True,
    )
    meaning = Text(
        "The stage's output is replaced by the truth, and the stages after it run on that; ignored "
        "pixels count as non-road, or lit: a bound on what mending the stage could bring.",
        "note",
    )
    yield Details("If a stage were perfect", [table, meaning, *_compensation(findings, rows)])


def _compensation(findings: Findings, oracles: Sequence[Mapping[str, Any]]) -> Iterator[Text]:
    """Return whether a filter that finds all shadow, and nothing else, would help."""
    if not {FILTERED, UNFILTERED} <= findings.totals.keys():
        return
    without = findings.total(UNFILTERED)
    for row in oracles:
        is_filter = row["oracle"] not in findings.totals[FILTERED]
        if row["variant"] == FILTERED and is_filter and row["frames"] == without["frames"]:
            meaning = "what it makes of true shadow helps."
            if row[TESTED] > without[TESTED]:
                meaning = "it is not only what it takes for shadow, but what it makes of shadow "
                meaning += "that does harm."
            yield Text(
                f"With a perfect shadow mask the filter would err {percent(row[TESTED])} %, and "
                f"{percent(without[TESTED])} % is the error without any filter: {meaning}",
                "note",
            )


def _heat_maps(maps: Mapping[str, Floats]) -> ImageGrid:
    """Return where each variant has false positives and negatives; equal shades are equal shares.

    ``maps`` are those of `roadeval.report.findings.Findings.heatmaps`.
    """
    most = [max(float(np.nanmax(own[place])) for own in maps.values()) for place in (0, 1)]
    pictures = [
        (f"{outcome} of {name}", heat_map(shares, top, colour))
        for name, own in maps.items()
        for outcome, shares, top, colour in zip(
            ("FP", "FN"), own, most, (colours.FP, colours.FN), strict=True
        )
    ]
    return ImageGrid(
        pictures,
        4,
        caption="Where the final masks go wrong, over all evaluated frames. FP: non-road called "
        f"road, the darkest on {percent(most[0], 1)} % of the frames that label the place; FN: "
        f"road missed, the darkest on {percent(most[1], 1)} %; grey: no frame labels it.",
    )


def thresholds(findings: Findings) -> Iterator[Block]:
    """Yield the curves and what is quoted of them; nothing without a probability."""
    quoted, levels = findings.facts.curves, findings.table("probabilities")
    if not quoted or not len(levels):
        return
    yield Heading("Over thresholds")
    chart = Figure(
        [
            charts.precision_over_recall(levels, findings.totals),
            charts.reliability(levels, findings.totals),
        ],
        "Precision over recall: a curve belongs to a variant that says how probable road is; a "
        "mark is a mask at its own threshold. Axes begin where the masks lie. Reliability: below "
        "the grey line road is said to be more probable than it is.",
    )
    meanings = Text(
        "All labelled pixels of the evaluated frames together. F is the harmonic mean of precision "
        "and recall; MaxF the greatest over all thresholds, and a threshold that was chosen on the "
        "drive that it is judged on flatters. AP: the mean precision over the steps of recall, "
        "without interpolation.",
        "note",
    )
    table = thresholds_table(quoted, findings.totals)
    yield Details("Precision, recall and MaxF", [chart, table, meanings])


def masks(findings: Findings) -> Iterator[Block]:
    """Yield what there is to see without truth."""
    yield Heading("Masks")
    yield Text(
        "Without truth nothing can be said about errors: not whether the road was found, not "
        "whether the filter helps, not which stage is at fault. What follows is what was computed."
    )
    if findings.examples:
        yield example_grid(findings.examples)
