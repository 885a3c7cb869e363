"""Where a mask fails, and why: classes taken for road, confirmed conditions, disturbances."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from roadeval.data import BASELINE
from roadeval.data.words import defined, in_percent, listing, number, percent, points
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.stats.difference import LEAST_GROUPS
from roadeval.evaluation.stats.slices import LEAST_FRAMES
from roadeval.evaluation.tables import by_class, only
from roadeval.report.blocks import (
    Block,
    BulletList,
    Cell,
    Details,
    Figure,
    Heading,
    KeepTogether,
    Table,
    Text,
)
from roadeval.report.captions import caption, note
from roadeval.report.chart import Chart, ChartKind, looks
from roadeval.report.charts.standard import OF_CLASSES, regions, series
from roadeval.report.findings import Findings
from roadeval.report.tables import breaks_of, variant_cell
from roadeval.results.facts import Facts, FleetFacts
from roadeval.results.fleet import FleetFolder
from roadeval.results.schema import DAMAGED, SCORED
from roadeval.results.sentences import correction, marked_interval
from roadeval.results.why import (
    describe_classes,
    describe_disturbances,
    describe_place,
    describe_slice,
)

MOST_CLASSES: Final = 8
"""Greatest number of classes in the charts."""
LEAST_SHARE: Final = 0.005
"""A class in the charts has at least this share of the false road or of the missed road."""


def classes(findings: Findings | FleetFolder) -> Iterator[Block]:
    """Yield each class's shares of the errors; nothing without classes."""
    import pandas as pd

    rows, focus = findings.table("classes"), findings.facts.focus
    names = [name for name in findings.facts.finals if name in {*rows["variant"]}]
    if focus not in names:
        return
    by_variant = {name: by_class(only(rows, variant=name)) for name in names}
    of_focus, parts = by_variant[focus], pd.concat(by_variant, names=["variant"])
    yield Heading("What is taken for road")
    if sentence := " ".join(describe_classes(rows, focus).values()):
        yield Text(f"{focus}: {sentence}")
    is_other = of_focus["truth"] == "other"
    is_wrong = is_other & (of_focus[[*OF_CLASSES]].max(axis=1) >= LEAST_SHARE)
    if titles := {name: name for name in of_focus.index[is_wrong][:MOST_CLASSES]}:
        shares = parts[[*OF_CLASSES]].assign(pixels=parts["of_other"])
        yield Figure(regions(shares, names, titles, OF_CLASSES), caption("classes"))
    columns: dict[str, list[Cell | str]] = {
        "class": [*of_focus.index],
        "truth": [*of_focus["truth"]],
        "of the pixels": [*map(percent, of_focus["pixels"].where(of_focus["truth"] != "ignored"))],
        "called road": [*map(percent, of_focus["road"])],
        "of the false road": [*map(percent, of_focus["false"].where(is_other))],
        "of the missed road": [*map(percent, of_focus["missed"].where(is_other))],
        "worst frames": [
            Cell(text, frames=[int(word) for word in text.split() if word.isdecimal()])
            for text in of_focus["worst"]
        ],
    }
    if isinstance(findings, FleetFolder):
        del columns["worst frames"]
    table = Table(
        [*columns],
        [*zip(*columns.values(), strict=True)],
        text_columns=[0, 1],
        caption=caption("table of classes", variant=focus),
        small=True,
    )
    yield Details("Every class in numbers", [table])


def when_it_fails(findings: Findings | FleetFolder, level: int = 1) -> Iterator[Block]:
    """Yield the conditions under which the focus fails, or a sentence that none is confirmed.

    Yield nothing without a search. Frames are links only below a heading of ``level`` 1.
    """
    facts, of_fleet = findings.facts, isinstance(findings, FleetFolder)
    slices = facts.slices.get(facts.focus or "")
    if isinstance(findings, FleetFolder):
        drives = findings.drives
        scored = drives[drives["status"].isin([SCORED, DAMAGED])].astype(object)
        groups = scored["group"].fillna(scored["log_digest"]).nunique()
        names, unit, few = findings.names, "drives", groups < 2 * LEAST_GROUPS
    else:
        names, unit, few = {}, "drive", findings.facts.frames.evaluated < LEAST_FRAMES
    if facts.focus is None or (slices is None and not few):
        return
    yield Heading("When it fails", level)
    if not slices:
        least = f"{2 * LEAST_GROUPS} groups of drives" if of_fleet else f"{LEAST_FRAMES} frames"
        name = "no slices" if slices is not None else "too little for slices"
        yield Text(caption(name, variant=facts.focus, unit=unit, least=least))
        return
    rows: list[list[Cell | str]] = []
    for failure in slices:
        yield Text(describe_slice(failure))
        frames = [str(frame) for frame in failure.worst]
        if failure.drives:
            pairs = zip(failure.drives, frames, strict=True)
            frames = [f"{names.get(drive, drive)} {frame}" for drive, frame in pairs]
        linked = [] if failure.drives or level > 1 else failure.worst
        ratio = f"{failure.ratio:.1f} ({failure.low:.1f} to {failure.high:.1f})"
        rates = percent(failure.inside), percent(failure.outside)
        worst = Cell(", ".join(frames), frames=linked)
        rows.append([describe_place(failure), number(failure.frames), *rates, ratio, worst])
    columns = ["where", "frames", "ERR, %", "elsewhere, %", "ratio", "worst frames"]
    yield Table(columns, rows, text_columns=(0, 5), small=True)
    yield note("slices", variant=facts.focus, unit=unit)


def disturbances(findings: Findings | FleetFolder) -> Iterator[Block]:
    """Yield ERR under each disturbance; nothing without disturbances."""
    facts = findings.facts
    if not facts.disturbances:
        return
    yield Heading("Fog, darkness and other disturbances")
    sentence = Text(describe_disturbances(facts.disturbances, facts.focus))
    by_variant, columns = looks([*facts.finals]), errors_by_variant(facts)
    names = [*next(iter(columns.values()))]
    marks = [
        series(name, by_variant[name], range(len(names)), [*map(in_percent, errors.values())])
        for name, errors in columns.items()
    ]
    chart = Chart("ERR by disturbance", ChartKind.MARKS, marks, names)
    yield KeepTogether([sentence, Figure([chart], caption("disturbances"))])
    family = [c.difference for changes in facts.disturbances.values() for c in changes.values()]
    rows: list[list[Cell | str]] = [
        [
            "" if place else variant_cell(variant, [*facts.finals]),
            change.text,
            *map(percent, (change.base_ERR, change.ERR)),
            points(change.difference.mean),
            marked_interval(change.difference),
            number(change.difference.better or 0),
            number(change.difference.worse or 0),
        ]
        for variant, changes in facts.disturbances.items()
        for place, change in enumerate(changes.values())
    ]
    table = Table(
        ["variant", "disturbed by", "from", "to", TESTED, "interval", "better", "worse"],
        rows,
        text_columns=(0, 1),
        breaks=breaks_of(rows),
        groups=[("", 2), ("ERR, %", 2), ("points", 2), (family[0].unit, 2)],
        caption=correction(family),
        small=True,
    )
    yield Details("Every disturbance in numbers", [table, note("disturbance intervals")])


def errors_by_variant(facts: Facts | FleetFacts) -> dict[str, dict[str, float | None]]:
    """Return each variant's ERR by the text of each disturbance; ``none`` is without any."""
    columns: dict[str, dict[str, float | None]] = {}
    texts = [c.text for changes in facts.disturbances.values() for c in changes.values()]
    for name, changes in facts.disturbances.items():
        columns[name] = {"none": facts.final_totals[name][TESTED]}
        columns[name] |= dict.fromkeys(texts) | {c.text: c.ERR for c in changes.values()}
    return columns


def brief(facts: Facts | FleetFacts) -> Iterator[Block]:
    """Yield what a terminal shows: ERR by disturbance and variant."""
    if columns := errors_by_variant(facts):
        cells = zip(*(map(percent, errors.values()) for errors in columns.values()), strict=True)
        names = next(iter(columns.values()))
        rows = [[text, *row] for text, row in zip(names, cells, strict=True)]
        legend = caption("disturbances")
        yield Table(["disturbed by", *columns], rows, text_columns=(0,), caption=legend, small=True)


def why(facts: Facts | FleetFacts, variant: str | None = None) -> Iterator[BulletList]:
    """Yield the reasons for the errors of a variant, by default the focus, if there are any.

    Paper shows only the reasons of the focus; a page shows the reasons of the chosen focus.
    """
    name = variant or facts.focus or ""
    if reasons := facts.why.get(name):
        is_focus = name == facts.focus
        yield BulletList(f"Why {name} errs", reasons, focus=name, on_paper=is_focus)


def worse_than_baseline(facts: Facts | FleetFacts) -> str:
    """Name the variants with a higher ERR than the baseline; empty without any."""
    errors = {name: total[TESTED] for name, total in facts.final_totals.items()}
    blind = errors.get(BASELINE)
    if not defined(blind):
        return ""
    worse = [name for name, error in errors.items() if defined(error) and error > blind]
    verb = "is" if len(worse) == 1 else "are"
    return f"{listing(worse)} {verb} worse than {BASELINE} (ERR {percent(blind)} %)" * bool(worse)


def beware(sentences: list[str]) -> BulletList:
    """Return a list of warnings, or a line if there is none."""
    tone = "warning" if sentences else "plain"
    return BulletList("Beware", sentences or [caption("nothing known")], tone)
