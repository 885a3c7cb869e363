"""ERR of the variants under disturbances: a sentence, a chart, and tables."""

from __future__ import annotations

from collections.abc import Iterator

from roadeval.data.words import in_percent, number, percent, points
from roadeval.evaluation.metrics import TESTED
from roadeval.report.blocks import Block, Cell, Details, Figure, Heading, KeepTogether, Table, Text
from roadeval.report.captions import caption, note
from roadeval.report.chart import Chart, ChartKind, looks
from roadeval.report.charts.standard import series
from roadeval.report.findings import Findings
from roadeval.report.tables import breaks_of, variant_cell
from roadeval.results.facts import Facts, FleetFacts
from roadeval.results.fleet import FleetFolder
from roadeval.results.sentences import correction, marked_interval
from roadeval.results.why import describe_disturbances


def section(findings: Findings | FleetFolder) -> Iterator[Block]:
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
        columns[name] = {"none": facts.totals[name][facts.finals[name]][TESTED]}
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
