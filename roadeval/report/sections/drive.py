"""The sections of one drive, from its first page to the command that makes it again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from roadeval.data import BASELINE, FILTERED, UNFILTERED, colours
from roadeval.data.words import (
    DASH,
    UNSET,
    defined,
    listing,
    number,
    percent,
    points,
    setting,
    short_names,
)
from roadeval.evaluation import tables
from roadeval.evaluation.metres import ABOVE
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.regions import titles
from roadeval.evaluation.tables import merge_names, only, perfect_stages
from roadeval.report.blocks import (
    Block,
    BulletList,
    Cell,
    Command,
    Details,
    Figure,
    Heading,
    ImageGrid,
    KeepTogether,
    LinkList,
    Table,
    Text,
)
from roadeval.report.captions import caption, note
from roadeval.report.charts import standard as charts
from roadeval.report.charts.standard import describe_points, figures_over_drive
from roadeval.report.findings import Findings
from roadeval.report.images import example_grid, heat_map, jpeg
from roadeval.report.sections.failures import beware, when_it_fails, why, worse_than_baseline
from roadeval.report.sections.frames import notable_frame
from roadeval.report.tables import (
    OTHERS,
    cameras_table,
    differences_table,
    rates_table,
    stages_table,
    thresholds_table,
    variant_cell,
)
from roadeval.results.fleet import FleetFolder
from roadeval.results.sentences import CLAIMED, account, correction

LOSSES: Final = 3
"""Greatest number of losses that are named."""


def summary(findings: Findings) -> Iterator[Block]:
    """Yield the first page of a drive."""
    yield Heading("Summary")
    facts = findings.facts
    if not findings.complete:
        yield BulletList("Partial recording", [caption("partial")], "warning")
    yield Text(facts.verdict, "verdict")
    for name in dict.fromkeys((facts.focus, *facts.why)):
        yield from why(facts, name)
    for frame in findings.worst[:1]:
        title = f"First frame to look at: {frame.frame}"
        if frame.rates:
            wrong = percent(frame.rates[frame.variant][TESTED], 1)
            title = caption("worst frame", frame=frame.frame, variant=frame.variant, ERR=wrong)
        command = findings.inspect(frame.frame) if findings.inspect else ""
        yield LinkList([(title, f"#frame-{frame.frame}")], command)
    if facts.totals:
        yield rates_table(facts)
    yield Text(account(facts.frames, facts.windows, facts.evaluation.window), "note")
    if findings.thumbnails:
        pictures = [(image.title, jpeg(image)) for image in findings.thumbnails]
        legend = caption("thumbnails without truth")
        if focus := facts.focus:
            legend = caption("thumbnails", variant=focus, errors=caption("errors"))
        yield ImageGrid(pictures, 4, caption=legend)
    yield beware([*warnings(findings)])


def warnings(findings: Findings) -> Iterator[str]:
    """Yield the reasons to doubt the numbers of a drive."""
    facts = findings.facts
    yield from facts.warnings
    trained_here = facts.training.model is None or facts.training.adapted
    if facts.training.source == "truth" and trained_here and findings.facts.totals:
        yield caption("trained on this drive")
    if worse := worse_than_baseline(facts):
        yield caption("worse than blind", worse=worse)
    for variant, total in facts.final_totals.items():
        if rates := [f"{rate} on {number(n)}" for rate, n in total["undefined"].items() if n]:
            frames, rates_named = number(total["frames"]), listing(rates)
            yield caption("undefined rates", variant=variant, frames=frames, rates=rates_named)
    yield from (f"Lost: {loss}" for loss in facts.losses[:LOSSES])
    if len(facts.losses) > LOSSES:
        yield caption("more losses", count=len(facts.losses) - LOSSES)
    if not findings.pictured:
        yield caption("no pictures")


def over_drive(findings: Findings, *, heading: bool = True) -> Iterator[Block]:
    """Yield the paper's claims and figures of the drive, with or without a heading."""
    claims = findings.facts.claims
    rows = [
        [words, f"{claims[name]['held']} of {claims[name]['windows']}"]
        for name, words in CLAIMED.items()
        if name in claims
    ]
    blocks: list[Block] = []
    if rows:
        legend = caption("claims", window=findings.facts.evaluation.window)
        blocks.append(Table(["claim", "true in"], rows, caption=legend))
    if findings.examples:
        blocks.append(example_grid(findings.examples, caption("figure 2")))
    about = describe_points(findings.windows) if len(findings.windows) else ""
    points = f" Here and below {about}."
    for figure in figures_over_drive():
        if drawn := figure.charts(findings.windows):
            blocks.append(Figure(drawn, f"{figure.caption}{points}"))
            points = ""
    if blocks and heading:
        yield Heading("Over the drive")
    if blocks:
        of_paper = "The paper's claims, and its figures 2, 3a and 3b"
        yield Details(of_paper if rows else "Masks and rates along the drive", blocks)


def filter_effect(findings: Findings) -> Iterator[Block]:
    """Yield the effects of the filter and the variants."""
    effects = findings.facts.final_effects
    if effects:
        filter_too = "the filter and " * (FILTERED in findings.facts.finals)
        yield Heading(f"What {filter_too}the variants change")
        yield differences_table(findings.facts)
        changes = [effect.rates[TESTED] for effect in effects]
        about = [caption("effects", baseline=BASELINE)]
        if with_interval := [change for change in changes if change.low is not None]:
            confidence = percent(with_interval[0].confidence, 0)
            about.append(caption("intervals", confidence=confidence))
        reasons = dict.fromkeys(change.none_because for change in changes if change.low is None)
        about += [caption("no interval", reason=reason) for reason in reasons if reason]
        yield Text(" ".join(filter(None, [*about, correction(changes)])), "note")
    pairs = tables.changes(findings.table("frames"), FILTERED, UNFILTERED)
    of_filter = (e.rates[TESTED] for e in effects if (e.variant, e.base) == (FILTERED, UNFILTERED))
    change = next(of_filter, None) if len(pairs) else None
    if change and not defined(change.mean):
        yield Text(caption("undefined effect"))
    elif change:
        steps = only(findings.table("changes"), from_variant=UNFILTERED, to_variant=FILTERED)
        for row in steps[steps["N"] > 0].to_dict("records"):  # a killed run has none
            right, wrong = (percent(row[name] / row["N"]) for name in ("repaired", "spoiled"))
            net = int(pairs["wrong"].sum())
            more = f"{number(abs(net))} {'more' if net > 0 else 'fewer'} wrong pixels in all"
            yield Text(caption("changed pixels", right=right, wrong=wrong, change=more))
        legend = caption("filter frame by frame", treated=FILTERED, control=UNFILTERED)
        figure = Figure([charts.difference(pairs, FILTERED, UNFILTERED, change)], legend)
        yield Details("The filter, frame by frame", [figure])


def over_time(findings: Findings) -> Iterator[Block]:
    """Tabulate the flicker of each final mask and of the truth, and the error episodes."""
    measures = {
        name: measured | measured["episodes"]
        for name, measured in findings.facts.beyond.items()
        if "episodes" in measured
    }
    if not measures:
        return
    rows: list[list[Cell | str]] = [
        [
            variant_cell(name, [*findings.facts.finals]),
            *(percent(measured[rate]) for rate in ("flicker", "truth_flicker")),
            points(measured["flicker"] - measured["truth_flicker"])
            if defined(measured["flicker"])
            else DASH,
            *(number(measured[count]) for count in ("pairs", "episodes")),
            *(f"{measured[time]:.1f}" for time in ("seconds", "longest")),
            percent(measured["share"]),
            number(measured["recovered"]),
            f"{measured['recovery']:.1f}" if measured["recovered"] else DASH,
        ]
        for name, measured in measures.items()
    ]
    table = Table(
        [
            *("final mask", "flicker, %", "the truth's, %", "beyond it", "pairs"),
            *("number", "seconds", "longest", "share, %", "recovered", "median recovery"),
        ],
        rows,
        groups=[("", 1), ("from frame to frame", 4), ("error episodes, seconds", 6)],
        small=True,
    )
    limit = percent(next(iter(measures.values()))["limit"], 0)
    meaning = note("flicker and episodes", limit=limit)
    yield Details("From one frame to the next", [table, meaning])


def regions(findings: Findings | FleetFolder) -> Iterator[Block]:
    """Yield the errors in each region of the image, for a drive or for many together."""
    if findings.regions.empty:
        return
    yield Heading("Where the errors are")
    # This region counts cells of ground: it has no share of the pixels.
    in_image = findings.regions.index.unique("region").drop(ABOVE, errors="ignore")
    names = titles([*in_image], findings.height)
    chart = charts.regions(findings.regions, [*findings.facts.finals], names)
    yield Figure(chart, caption("regions"))
    shadow = caption("detected shadow") if "shadow" in names else ""
    width = findings.facts.evaluation.boundary_width
    sentences = [shadow, caption("meaning of regions", width=width)]
    yield Text(" ".join(filter(None, sentences)), "note")
    if not isinstance(findings, Findings):
        return
    trimaps = {n: m["trimap"] for n, m in findings.facts.beyond.items() if "trimap" in m}
    blocks: list[Block] = [Figure([charts.trimap(trimaps)], caption("trimap"))] if trimaps else []
    if maps := findings.heatmaps:  # equal shades are equal shares
        most = [max(float(np.nanmax(both[n])) for both in maps.values()) for n in (0, 1)]
        pictures = [
            (f"{outcome} of {name}", heat_map(shares, top, colour))
            for name, both in maps.items()
            for outcome, shares, top, colour in zip(
                ("FP", "FN"), both, most, (colours.FP, colours.FN), strict=True
            )
        ]
        darkest = dict(zip(("fp", "fn"), (percent(share, 1) for share in most), strict=True))
        blocks.append(ImageGrid(pictures, 4, caption=caption("heat maps", **darkest)))
    if blocks:
        yield Details("By distance from the road's edge, and by place in the image", blocks)


def stages(findings: Findings) -> Iterator[Block]:
    """Yield the rates of each stage's mask, and each stage's part of the error."""
    yield Heading("Which stage broke it")
    yield Figure(charts.stages(findings.facts.totals), caption("stages", baseline=BASELINE))
    columns = merge_names(findings.error_parts.values())
    yield Table(
        ["final mask", *columns, TESTED],
        [
            [
                variant_cell(variant, [*findings.facts.totals]),
                *((points if p in [*parts][1:] else percent)(parts.get(p)) for p in columns),
                percent(findings.facts.final_totals[variant][TESTED]),
            ]
            for variant, parts in findings.error_parts.items()
        ],
    )
    both = {FILTERED, UNFILTERED} <= findings.facts.totals.keys()
    name = "error parts with the filter" if both else "error parts"
    yield note(name, filtered=FILTERED, unfiltered=UNFILTERED)
    numbers: list[Block] = [stages_table(findings.facts.totals, findings.changes)]
    if findings.changes:
        numbers.append(note("repaired and spoiled"))
    yield Details("Every stage in numbers", numbers)


def oracles(findings: Findings) -> Iterator[Block]:
    """Yield the errors that remain if the truth replaces a stage; nothing if not counted."""
    rows = [*perfect_stages(findings.table("oracles"), findings.table("frames"))]
    if not rows:
        return
    table = Table(
        [
            *("variant", "perfect stage", "ERR as it is", "ERR then", "change, points"),
            *(*(f"{name} then" for name in OTHERS), "frames"),
        ],
        [
            [
                variant_cell(row["variant"], [*findings.facts.totals]),
                row["oracle"],
                percent(row["as_is"]),
                percent(row[TESTED]),
                points(row[TESTED] - row["as_is"]),
                *(percent(row[name]) for name in OTHERS),
                number(row["frames"]),
            ]
            for row in rows
        ],
        text_columns=(0, 1),
        small=True,
    )
    blocks = [table, note("perfect stages")]
    totals = findings.facts.totals
    for row in rows if {FILTERED, UNFILTERED} <= totals.keys() else ():
        is_filter = row["variant"] == FILTERED and row["oracle"] not in totals[FILTERED]
        without = findings.facts.final_totals[UNFILTERED]
        if is_filter and row["frames"] == without["frames"]:
            helps = row[TESTED] <= without[TESTED]
            meaning = caption("perfect filter helps" if helps else "perfect filter harms")
            errors = {"perfect": percent(row[TESTED]), "without": percent(without[TESTED])}
            blocks.append(note("perfect filter", **errors, meaning=meaning))
    yield Details("If a stage were perfect", blocks)


def thresholds(findings: Findings) -> Iterator[Block]:
    """Yield curves over thresholds and their numbers; nothing without probabilities."""
    curves, levels = findings.facts.curves, findings.table("probabilities")
    if not curves or not len(levels):
        return
    yield Heading("Over thresholds")
    totals = findings.facts.totals
    drawn = [charts.precision_over_recall(levels, totals), charts.reliability(levels, totals)]
    chart, table = Figure(drawn, caption("curves")), thresholds_table(curves, totals)
    blocks = [chart, table, note("meaning of thresholds")]
    yield Details("Precision, recall and MaxF", blocks)


def masks(findings: Findings) -> Iterator[Block]:
    """Yield the masks of a drive without truth."""
    yield Heading("Masks")
    yield Text(caption("without truth"))
    if findings.examples:
        yield example_grid(findings.examples)


def cameras(findings: Findings) -> Iterator[Block]:
    """Tabulate ERR of each camera's final masks, and the filter's effect."""
    yield Heading("Cameras")
    yield cameras_table(findings.facts)


def each_camera(findings: Findings) -> Iterator[Block]:
    """Yield the verdict, the rates and the worst frame of each camera."""
    names = short_names([*findings.cameras])
    for camera, of_camera in findings.cameras.items():
        facts = of_camera.facts
        yield Heading(f"Camera {names[camera]}")
        topic = camera if names[camera] != camera.strip("/") else ""
        size = f"{facts.drive.width} \N{MULTIPLICATION SIGN} {facts.drive.height}"
        yield Text(", ".join(filter(None, (topic, size))), "note")
        yield Text(facts.verdict)
        if facts.totals:
            yield Details("Rates of every final mask", [rates_table(facts)])
        yield from when_it_fails(of_camera, level=2)
        for frame in of_camera.worst[:1]:
            yield KeepTogether([*notable_frame(of_camera, frame)])


def provenance(findings: Findings) -> Iterator[Block]:
    """Yield the log, the methods and the command that makes the results again."""
    facts = findings.facts
    yield Heading("How to reproduce this")
    if facts.log:
        digest = Text(f"Digest of its index and checksums: {facts.log.digest}")
        again = [Command(findings.again), note("reproduced")] if findings.again else []
        yield KeepTogether([Text(f"Log: {facts.log.path}"), digest, *again])
    for name, labels in facts.masks.items():
        yield Text(f"{name}: {labels['path']}, digest {labels['digest']}", "note")
    # Stages, such as networks, describe themselves.
    for variant, stages in facts.methods.items():
        for stage, description in stages.items():
            rows = dict(flatten(description))
            if (seconds := facts.seconds.get(variant, {}).get(stage)) is not None:
                rows["ms a frame"] = f"{1e3 * seconds:.2f}"
            yield Details(f"{variant}: {stage}", [_words(["what", "value"], [*rows.items()])])
    details: list[Block] = [Text(topic, "note") for topic in facts.drive.topics]
    # The log's digest and the settings above tell more than the digest of the input.
    properties = [
        f"{name}: {value}"
        for name, value in findings.properties.items()
        if name != "input" and value != ""
    ]
    if properties:
        details.append(Text("; ".join(properties), "note"))
    if facts.versions:
        details.append(_words(["package", "version"], [*facts.versions.items()]))
    if facts.seconds:
        times = [
            [variant, stage, f"{1e3 * seconds:.2f}"]
            for variant, stages in facts.seconds.items()
            for stage, seconds in stages.items()
        ]
        details.append(_words(["variant", "stage", "ms a frame"], times))
    if details:
        yield Details("Topics, versions, milliseconds", details, on_paper=False)


def _words(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a small table with words in its first two columns."""
    return Table(columns, rows, text_columns=(0, 1), small=True)


def flatten(settings: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield settings that have a value, by their dotted names.

    >>> list(flatten({"svm": {"kernel": "rbf"}, "size": [4, 3], "seed": None}))
    [('svm.kernel', 'rbf'), ('size', '4, 3')]
    """
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from flatten(value, f"{prefix}{name}.")
        elif (text := setting(value)) != UNSET:
            yield f"{prefix}{name}", text
