"""The report of a comparison: as a document with figures, and as Markdown for a pull request."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any, Final

from roadeval.data.words import DASH, interval, listing, number, percent, points, timestamp
from roadeval.evaluation.comparison import (
    Change,
    ComparedResult,
    Comparison,
    Disagreement,
    DriveChange,
    Judgement,
    MovedFrame,
    RegionChange,
)
from roadeval.evaluation.metrics import SHORT, SHORT_OVERLAP
from roadeval.evaluation.score import TESTED
from roadeval.evaluation.stats import Difference
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
from roadeval.report.chart import Chart
from roadeval.report.charts import differences
from roadeval.report.charts.differences import MEAN, ForestRow
from roadeval.report.fleet.common import MarkedRow, q_value, strata_table
from roadeval.results.comparison import (
    changed_drives,
    changed_settings,
    discovery_note,
    judged,
    verdict,
    warnings,
)
from roadeval.results.comparison import where as told_where
from roadeval.results.sentences import MARK, correction, stands
from roadeval.runtime.text import as_markdown

Inspect = Callable[[str, int], str]
Row = Change | MovedFrame | RegionChange | Disagreement | DriveChange
"""Something about a variant of a new result."""
Columns = dict[str, Callable[[Any], Cell | str]]
"""What a row has in each column, by their titles."""
OTHERS: Final = tuple(name for name in SHORT if name != TESTED)
"""The rates of short tables without ERR, which has columns of its own."""
NAMED: Final = 20
"""Drives that a table of changed ones names, of each mask."""
_COMMAND: Final = "in the viewer"
_WORDS: Final = ("result", "variant", "stage", "drive", "region, or frames", "stamp", _COMMAND)
"""The columns that hold words."""
_REGIONS: Final = "ERR of the final masks, percent: means over the frames that label any of it."
_FRAMES: Final = "Percent of the labelled pixels that one of the two final masks has right alone."
_LEFT_OUT: Final = (
    "A region that is not the same pixels in both, as the shadow that another filter found, is "
    "left out. Frames with most shadow are a third, by the share of their pixels in true shadow, "
    "or in that which both detected."
)


def document(
    comparison: Comparison,
    judgements: Sequence[Judgement],
    over_drive: Sequence[Chart],
    inspect: Inspect | None = None,
) -> Document:
    """Return a comparison as a document.

    Parameters
    ----------
    comparison
        The comparison.
    judgements
        Of the limits that were set.
    over_drive
        The rates of the masks over the drive; may be none.
    inspect
        Returns the command that opens a frame of a result, by its label; None: no commands.
    """
    labels = [each.label for each in comparison.results]
    return Document(
        kicker="roadeval comparison",
        title=listing(labels),
        subtitle="; ".join(map(_about, comparison.results)),
        footer=f"comparison of {listing(labels)}",
        blocks=list(_blocks(comparison, judgements, over_drive, inspect)),
        keywords=["road recognition", "comparison"],
    )


def markdown(comparison: Comparison, judgements: Sequence[Judgement]) -> str:
    """Return a comparison as Markdown."""
    lines = ["# roadeval comparison", ""]
    lines += [line for each in changed_settings(comparison) for line in (as_markdown(each), "")]
    lines += [as_markdown(verdict(comparison)), ""]
    lines += [
        f"- {'**FAIL**' if each.holds else 'ok'}: {as_markdown(judged(each))}"
        for each in judgements
    ]
    lines += ["", *_rates_table(comparison).markdown(), ""]
    lines += [line for legend in _legend(comparison) for line in (as_markdown(legend), "")]
    lines += [*(f"- {as_markdown(sentence)}" for sentence in told_where(comparison)), ""]
    for title, table in (
        ("Drives that changed:", _drives_table([r for r in comparison.drives if r.changed])),
        ("Frames on which they disagree most:", _disagreement_table(comparison.disagreements)),
        ("Frames that changed most:", _moved_table(comparison.moved)),
    ):
        if table.rows:
            lines += [title, "", *table.markdown(), ""]
    lines += [f"- {as_markdown(warning)}" for warning in warnings(comparison)]
    lines += ["", _unit(comparison)]
    return "\n".join(lines).rstrip() + "\n"


def _about(result: ComparedResult) -> str:
    if result.drive is not None:
        return f"{result.label}: {result.frames} frames of {result.drive}"
    return f"{result.label}: {number(result.scored)} of {number(result.drives)} drives scored"


def _blocks(
    comparison: Comparison,
    judgements: Sequence[Judgement],
    over_drive: Sequence[Chart],
    inspect: Inspect | None,
) -> Iterator[Block]:
    yield Heading("What changed")
    yield from (Text(line) for line in changed_settings(comparison))
    yield Text(verdict(comparison), "verdict")
    for title, holds, tone in (
        ("Limits exceeded", True, "warning"),
        ("Limits kept", False, "plain"),
    ):
        if told := [judged(each) for each in judgements if each.holds == holds]:
            yield BulletList(title, told, tone)
    yield _rates_table(comparison)
    yield Text(_unit(comparison), "note")
    yield from (Text(legend, "note") for legend in _legend(comparison))
    if comparison.notes:
        yield BulletList("Beware", warnings(comparison), "warning")
    yield TableOfContents(depth=2)
    finals = [row for row in comparison.changes if row.final]
    if comparison.paired:
        yield Figure(
            differences.changes(finals), "Change of the final mask's rates against the base."
        )
    else:
        yield Figure(differences.levels(finals), "Rates of the final masks.")
    if over_drive:
        yield Heading("Over the drive", 2)
        yield Figure(over_drive, f"{TESTED} of the final masks over the common frames.")
    yield from _drives(comparison)
    yield from _where(comparison)
    if comparison.moved:
        yield Heading("Frames that changed most", 2)
        yield _moved_table(comparison.moved, inspect)


def _legend(comparison: Comparison) -> Iterator[str]:
    """Yield what the mark in the table means, where something was corrected."""
    changes = [row.difference[TESTED] for row in comparison.changes if row.difference]
    if legend := correction(changes):
        yield legend


def _unit(comparison: Comparison) -> str:
    if not comparison.paired:
        return "Percent over each result's own frames."
    over = (
        "Percent: means over the drives that both have, of the frames that both evaluated; a group "
        "of drives counts as one."
        if comparison.drives
        else "Percent over the frames that both evaluated."
    )
    return f"{over} Differences are new minus base, in percentage points."


# --- Rates ----------------------------------------------------------------------------------------


def _rates_table(comparison: Comparison) -> Table:
    """Tabulate the rates of every result, variant and stage, and their changes."""
    rows = comparison.changes
    return _changes_table(rows) if comparison.paired else _levels_table(rows)


def _changes_table(rows: Sequence[Change]) -> Table:
    counted: Columns = {"drives": lambda row: number(row.drives)}
    columns: Columns = {
        "stage": lambda row: row.stage,
        **(counted if any(row.drives > 1 for row in rows) else {}),
        "base": lambda row: percent(row.base[TESTED]),
        "new": lambda row: percent(row.new[TESTED]),
        "difference": lambda row: Cell(points(row.difference[TESTED].mean), bold=row.final),
        "interval": lambda row: _interval(row.difference[TESTED]),
        **{rate: partial(_other, rate=rate) for rate in OTHERS},
    }
    table = _table(rows, columns)
    named = len(table.columns) - 4 - len(OTHERS)
    groups = [("", named), (TESTED, 4), ("difference", len(OTHERS))]
    return replace(table, groups=groups)


def _other(row: Change, rate: str) -> str:
    return points(row.difference[rate].mean)


def _levels_table(rows: Sequence[Change]) -> Table:
    columns: Columns = {
        "stage": lambda row: row.stage,
        "frames": lambda row: number(row.frames),
        **{rate: partial(_level, rate=rate) for rate in (*SHORT, *SHORT_OVERLAP)},
    }
    return _table(rows, columns)


def _level(row: Change, rate: str) -> str:
    return percent(row.new[rate])


def _table(rows: Sequence[Row], columns: Columns, caption: str = "") -> Table:
    """Tabulate rows: what names one, without the result where the variants are that, and columns.

    A rule stands where another result begins.
    """
    names: Columns = {"result": lambda row: row.result, "variant": lambda row: row.variant}
    if all(row.result == row.variant for row in rows):
        del names["result"]
    made = names | columns
    results = [row.result for row in rows]
    return Table(
        [*made],
        [[cell(row) for cell in made.values()] for row in rows],
        text_columns=[place for place, title in enumerate(made) if title in _WORDS],
        breaks=[place for place, (a, b) in enumerate(pairwise(results), 1) if a != b],
        caption=caption,
        small=True,
    )


def _interval(change: Difference) -> str:
    """Return an interval, with a mark where the change stands after correction."""
    mark = f" {MARK}" if stands(change.p_holm, change.confidence) else ""
    return interval(change.low, change.high) + mark


# --- Drives ---------------------------------------------------------------------------------------


def _drives(comparison: Comparison) -> Iterator[Block]:
    """Yield which of several drives changed, the plot of all, and the changes by tag."""
    if not comparison.drives:
        return
    yield Heading("Which drives changed")
    yield from (Text(line) for line in changed_drives(comparison))
    yield Text(discovery_note(), "note")
    masks = dict.fromkeys((row.result, row.variant) for row in comparison.drives)
    for place, mask in enumerate(masks):
        own = [row for row in comparison.drives if (row.result, row.variant) == mask]
        if not place:
            yield from _plot(comparison, own)
        if rows := [row for row in own if row.changed]:
            shown = f" ({NAMED} of {len(rows)})" if len(rows) > NAMED else ""
            title = " of ".join(reversed(mask)) if len(comparison.results) > 2 else mask[1]
            yield Heading(f"Drives on which {title} changed{shown}, the surest first", 2)
            yield _drives_table(rows)
    for mask in masks:
        parts = [
            MarkedRow.of_stratum(each.stratum)
            for each in comparison.strata
            if (each.result, each.variant) == mask
        ]
        if any(part.mean for part in parts):
            yield Heading(f"Change of {TESTED} of {mask[1]} by tag", 2)
            yield from strata_table(parts)


def _plot(comparison: Comparison, own: Sequence[DriveChange]) -> Iterator[Block]:
    first = own[0]
    rows = [
        ForestRow(row.drive, None, row.difference.mean, row.difference.low, row.difference.high)
        for row in own
        if row.difference.units
    ]
    if not rows:
        return
    key = (first.result, first.variant, first.stage)
    (over,) = (
        each.difference[TESTED]
        for each in comparison.changes
        if (each.result, each.variant, each.stage) == key
    )
    mean = ForestRow(MEAN, None, over.mean, over.low, over.high)
    label = f"change of {TESTED} of {first.variant}"
    yield Figure(differences.forest(rows, mean, label), differences.caption(rows, mean))


def _drives_table(rows: Sequence[DriveChange]) -> Table:
    """Tabulate drives that changed, the surest first."""
    columns: Columns = {
        "drive": lambda row: row.drive,
        "frames": lambda row: number(row.frames),
        "base": lambda row: percent(row.base),
        "new": lambda row: percent(row.new),
        "difference": lambda row: Cell(points(row.difference.mean), bold=True),
        "interval": lambda row: interval(row.difference.low, row.difference.high),
        "q": lambda row: DASH if row.q is None else q_value(row.q),
    }
    return _table(rows[:NAMED], columns)


# --- Where ----------------------------------------------------------------------------------------


def _where(comparison: Comparison) -> Iterator[Block]:
    """Yield where one of two methods is better: by region and shade, and where they disagree."""
    if comparison.regions:
        legend = correction(row.difference for row in comparison.regions)
        yield Heading("Where it is better, and where worse", 2)
        yield _region_table(comparison.regions)
        yield Text(f"{legend} {_LEFT_OUT}".strip(), "note")
    if comparison.disagreements:
        yield Heading("Frames on which they disagree most", 2)
        yield _disagreement_table(comparison.disagreements)


def _region_table(rows: Sequence[RegionChange]) -> Table:
    columns: Columns = {
        "region, or frames": lambda row: row.title,
        "frames": lambda row: str(row.frames),
        "base": lambda row: percent(row.base),
        "new": lambda row: percent(row.new),
        "difference": lambda row: Cell(points(row.difference.mean), bold=True),
        "interval": lambda row: _interval(row.difference),
    }
    return _table(rows, columns, _REGIONS)


def _disagreement_table(rows: Sequence[Disagreement]) -> Table:
    """Tabulate the frames on which final masks disagree most, and which of them is right."""
    columns: Columns = {
        "frame": lambda row: str(row.frame),
        "stamp": lambda row: timestamp(row.stamp_ns),
        "disagree": lambda row: Cell(percent(row.base_right + row.new_right), bold=True),
        "base right": lambda row: percent(row.base_right),
        "new right": lambda row: percent(row.new_right),
    }
    return _table(rows, columns, _FRAMES)


def _moved_table(rows: Sequence[MovedFrame], inspect: Inspect | None = None) -> Table:
    """Tabulate the frames whose error rate changed most, with what opens each of the new result."""
    columns: Columns = {
        "frame": lambda row: str(row.frame),
        "stamp": lambda row: timestamp(row.stamp_ns),
        "ERR base": lambda row: percent(row.base),
        "new": lambda row: percent(row.new),
        "difference": lambda row: Cell(points(row.change), bold=True),
    }
    if inspect:
        columns[_COMMAND] = lambda row: inspect(row.result, row.frame)
    return _table(rows, columns)
