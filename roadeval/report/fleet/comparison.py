"""The report of a comparison of two fleets: as a document with figures, and as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from roadeval.data.words import DASH, interval, number, percent, points
from roadeval.evaluation.drives_comparison_result import TESTED, DriveChange, FleetChange
from roadeval.evaluation.drives_conditions import FleetJudgement
from roadeval.evaluation.metrics import SHORT
from roadeval.report.blocks import (
    Block,
    BulletList,
    Cell,
    Document,
    Figure,
    Heading,
    Table,
    TableOfContents,
    Text,
)
from roadeval.report.charts.differences import MEAN, ForestRow, caption, forest
from roadeval.report.fleet.common import (
    MarkedRow,
    q_value,
    strata_table,
)
from roadeval.report.markdown import table as markdown_table
from roadeval.results.certainty import MARK, correction, stands
from roadeval.results.fleet.comparison import (
    FleetComparison,
    changed_drives,
    discovery_note,
    judged,
    verdict,
    warnings,
)
from roadeval.runtime.text import as_markdown

OTHERS: Final = tuple(name for name in SHORT if name != TESTED)
NAMED: Final = 20
"""Drives that a table of changed ones names, in each direction together."""
UNIT: Final = (
    "Percent: means over the drives that both have, of the frames that both evaluated. "
    "Differences are new minus base, in percentage points; a group of drives counts as one."
)


def document(comparison: FleetComparison, judgements: Sequence[FleetJudgement]) -> Document:
    """Return a comparison of two fleets as a document."""
    base, new = comparison.base, comparison.new
    return Document(
        kicker="roadeval comparison of fleets",
        title=f"{base.label} and {new.label}",
        subtitle="; ".join(
            f"{each.label}: {number(each.scored)} of {number(each.drives)} drives scored"
            for each in (base, new)
        )
        + f"; {number(comparison.drives)} in both",
        footer=f"comparison of {base.label} and {new.label}",
        blocks=list(_blocks(comparison, judgements)),
        keywords=["road recognition", "fleet", "comparison"],
    )


def markdown(comparison: FleetComparison, judgements: Sequence[FleetJudgement]) -> str:
    """Return a comparison of two fleets as Markdown."""
    lines = ["# roadeval comparison of fleets", "", as_markdown(verdict(comparison)), ""]
    lines += [
        f"- {'**FAIL**' if each.holds else 'ok'}: {as_markdown(judged(each, comparison))}"
        for each in judgements
    ]
    if comparison.changes:
        lines += ["", *markdown_table(changes_table(comparison)), ""]
        lines += [line for legend in _legend(comparison) for line in (as_markdown(legend), "")]
    for change in comparison.finals():
        mask = change.variant, change.stage
        lines += [as_markdown(changed_drives(comparison, mask)), ""]
        if rows := comparison.changed(mask):
            lines += [*markdown_table(drives_table(rows, comparison.names)), ""]
    lines += [f"- {as_markdown(warning)}" for warning in warnings(comparison)]
    lines += ["", as_markdown(discovery_note()), "", UNIT]
    return "\n".join(lines).rstrip() + "\n"


def _blocks(comparison: FleetComparison, judgements: Sequence[FleetJudgement]) -> Iterator[Block]:
    yield Heading("What changed")
    yield Text(verdict(comparison), "verdict")
    for title, holds, tone in (
        ("Limits exceeded", True, "warning"),
        ("Limits kept", False, "plain"),
    ):
        if told := [judged(each, comparison) for each in judgements if each.holds == holds]:
            yield BulletList(title, told, tone)
    if comparison.changes:
        yield changes_table(comparison)
        yield Text(UNIT, "note")
        yield from (Text(legend, "note") for legend in _legend(comparison))
    if comparison.left_out or warnings(comparison):
        yield BulletList("Beware", warnings(comparison), "warning")
    yield TableOfContents()
    yield from _drives(comparison)
    yield from _strata(comparison)


def _drives(comparison: FleetComparison) -> Iterator[Block]:
    """Yield which drives changed, and the plot of all."""
    finals = comparison.finals()
    yield Heading("Which drives changed")
    for change in finals:
        yield Text(changed_drives(comparison, (change.variant, change.stage)))
    yield Text(discovery_note(), "note")
    first, *_ = finals
    yield from _plot(comparison, first)
    for change in finals:
        rows = comparison.changed((change.variant, change.stage))
        if rows:
            shown = f" ({NAMED} of {len(rows)})" if len(rows) > NAMED else ""
            yield Heading(f"Drives on which {change.variant} changed{shown}, the surest first", 2)
            yield drives_table(rows, comparison.names)


def _plot(comparison: FleetComparison, change: FleetChange) -> Iterator[Block]:
    own = (change.variant, change.stage)
    rows = [
        ForestRow(comparison.names[row.drive], None, row.mean, row.low, row.high)
        for row in comparison.drive_changes
        if (row.variant, row.stage) == own and row.mean == row.mean
    ]
    if not rows:
        return
    over = change.difference[TESTED]
    mean = ForestRow(MEAN, None, over.mean, over.low, over.high)
    label = f"change of {TESTED} of {change.variant}"
    yield Figure(forest(rows, mean, label), caption(rows, mean))


def _strata(comparison: FleetComparison) -> Iterator[Block]:
    for change in comparison.finals():
        rows = [
            MarkedRow.of_stratum(each.stratum)
            for each in comparison.strata
            if (each.variant, each.stage) == (change.variant, change.stage)
        ]
        if any(row.mean for row in rows):
            yield Heading(f"Change of {TESTED} of {change.variant} by tag", 2)
            yield from strata_table(rows)


def _legend(comparison: FleetComparison) -> list[str]:
    """Return what the mark in the table means, where something was corrected."""
    told = correction({"comparisons": each.comparisons} for each in comparison.changes)
    return [told] if told else []


def changes_table(comparison: FleetComparison) -> Table:
    """Tabulate the change of every mask over drives."""
    rows: list[list[Cell | str]] = []
    breaks = []
    for place, change in enumerate(comparison.changes):
        first = place == 0 or comparison.changes[place - 1].variant != change.variant
        if first and place:
            breaks.append(place)
        over = change.difference[TESTED]
        mark = f" {MARK}" if stands(change.p_holm, over.confidence) else ""
        rows.append(
            [
                change.variant if first else "",
                change.stage,
                number(change.drives),
                percent(change.base[TESTED]),
                percent(change.new[TESTED]),
                Cell(points(over.mean), bold=change.final),
                interval(over.low, over.high) + mark,
                *(points(change.difference[rate].mean) for rate in OTHERS),
            ]
        )
    titles = ["base", "new", "change", "interval"]
    return Table(
        ["variant", "stage", "drives", *titles, *OTHERS],
        rows,
        text_columns=(0, 1),
        breaks=breaks,
        groups=[("", 3), (TESTED, 4), ("change", len(OTHERS))],
        small=True,
    )


def drives_table(rows: Sequence[DriveChange], names: Mapping[str, str]) -> Table:
    """Tabulate drives that changed, the surest first."""
    return Table(
        ["drive", "frames", "base", "new", "change", "interval", "q"],
        [
            [
                names[row.drive],
                number(row.frames),
                percent(row.base),
                percent(row.new),
                Cell(points(row.mean), bold=True),
                interval(row.low, row.high),
                DASH if row.q is None else q_value(row.q),
            ]
            for row in rows[:NAMED]
        ],
        small=True,
    )
