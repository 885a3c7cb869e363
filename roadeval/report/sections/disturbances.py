"""How the variants stand disturbances: a chart, a sentence, and a table of ERR."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from roadeval.data.words import in_percent, number, percent, points
from roadeval.evaluation.metrics import TESTED
from roadeval.report.blocks import Block, Cell, Details, Figure, Heading, Table, Text
from roadeval.report.captions import caption, note
from roadeval.report.chart import Chart, ChartKind, looks
from roadeval.report.charts.standard import series
from roadeval.report.findings import Findings
from roadeval.report.tables import variant_cell
from roadeval.results.facts import Facts, FleetFacts
from roadeval.results.fleet import FleetFolder
from roadeval.results.sentences import correction, describe_disturbances, marked_interval

UNDISTURBED: Final = "none"


def section(findings: Findings | FleetFolder) -> Iterator[Block]:
    """Yield ERR under each disturbance; nothing if there was none."""
    facts = findings.facts
    if not facts.disturbances:
        return
    yield Heading("How it stands disturbances")
    yield Text(describe_disturbances(facts.disturbances, facts.focus))
    yield Figure([_chart(facts)], caption("disturbances"))
    yield Details("Every disturbance in numbers", [_table(facts), note("disturbance intervals")])


def _chart(facts: Facts | FleetFacts) -> Chart:
    rows, marks = _errors(facts), []
    by_variant = looks([*facts.finals])
    for place, variant in enumerate(facts.disturbances):
        errors = [100 * row[place] for row in rows.values()]
        marks.append(series(variant, by_variant[variant], range(len(rows)), errors))
    return Chart("ERR by disturbance", ChartKind.MARKS, marks, names=[*rows])


def _errors(facts: Facts | FleetFacts) -> dict[str, list[float]]:
    """Return ERR of each variant that was disturbed, by disturbance, the first without any."""
    finals = {name: facts.totals[name][facts.finals[name]] for name in facts.disturbances}
    rows = {UNDISTURBED: [float(rates[TESTED]) for rates in finals.values()]}
    by_name: dict[str, dict[str, float | None]] = {}
    for variant, changes in facts.disturbances.items():
        for change in changes.values():
            by_name.setdefault(change.disturbance, {})[variant] = change.ERR
    for text, errors in by_name.items():
        rows[text] = [in_percent(errors.get(name)) / 100 for name in finals]
    return rows


def errors_table(facts: Facts | FleetFacts) -> Table:
    """Tabulate ERR alone: a row for each disturbance, a column for each variant."""
    return Table(
        ["disturbed by", *facts.disturbances],
        [[text, *map(percent, errors)] for text, errors in _errors(facts).items()],
        text_columns=(0,),
        caption=caption("disturbances"),
        small=True,
    )


def _table(facts: Facts | FleetFacts) -> Table:
    rows: list[list[Cell | str]] = []
    breaks, unit = [], ""
    for variant, changes in facts.disturbances.items():
        breaks.append(len(rows))
        for place, change in enumerate(changes.values()):
            difference = change.difference
            unit = difference.unit
            rows.append(
                [
                    "" if place else variant_cell(variant, [*facts.finals]),
                    change.disturbance,
                    *map(percent, (change.base_ERR, change.ERR)),
                    points(difference.mean),
                    marked_interval(difference),
                    *(number(n or 0) for n in (difference.better, difference.worse)),
                ]
            )
    family = [c.difference for changes in facts.disturbances.values() for c in changes.values()]
    return Table(
        [
            "variant",
            "disturbed by",
            "from, %",
            "to, %",
            "change, pp",
            "interval, pp",
            "better",
            "worse",
        ],
        rows,
        text_columns=(0, 1),
        breaks=breaks[1:],
        groups=[("", 2), ("ERR", 4), (unit, 2)],
        caption=correction(family),
        small=True,
    )
