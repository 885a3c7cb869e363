"""A comparison on one screen of 80 columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

from roadeval.cli.screens import tables
from roadeval.cli.screens.tables import Row, interval, marked, percent, points
from roadeval.evaluation.comparison import Change, Comparison, DriveChange, Judgement
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.score import TESTED
from roadeval.results.comparison import NAMED, changed_settings, judged, verdict, where
from roadeval.results.sentences import correction

if TYPE_CHECKING:
    from rich.console import Console


CHANGE: Final = ("base %", "new %", "change pp", "interval pp")
LEVEL: Final = ("frames", *(f"{name} %" for name in SHORT))
"""The titles of numbers where results are subtracted, and where they stand side by side."""
DRIVES: Final = 10
"""Drives that changed, which are named for each mask."""


def show(comparison: Comparison, judgements: Sequence[Judgement], out: Console) -> None:
    """Print what changed, what that means, and the conditions that were kept."""
    for line in changed_settings(comparison, NAMED):
        out.print(line, soft_wrap=True)
    base, *_ = comparison.results
    for title, rows in _groups(comparison.changes):
        if not comparison.paired:
            out.print(title, soft_wrap=True)
            tables.show(("variant", "stage"), LEVEL, list(_levels(rows)), out)
            out.print()
            continue
        drives = max(row.drives for row in rows)
        over = f": {drives} drives in common" if drives > 1 else ""
        against = f"{title} against {base.label}" if title else f"against {base.label}"
        out.print(f"{against}{over}", soft_wrap=True)
        tables.show(("variant", "stage", "rate"), CHANGE, list(_changes(rows)), out)
        if legend := correction(change.difference[TESTED] for change in rows):
            out.print(legend)
        out.print()
    _show_drives(comparison, out)
    out.print(verdict(comparison))
    for sentence in where(comparison):
        out.print(sentence)
    for judgement in judgements:
        if not judgement.holds:
            out.print(judged(judgement), soft_wrap=True)


def _groups(changes: Sequence[Change]) -> list[tuple[str, list[Change]]]:
    """Part the rows by result; the variants of a single one stay together."""
    if all(change.result == change.variant for change in changes):
        return [("", list(changes))]
    labels = dict.fromkeys(change.result for change in changes)
    return [(label, [c for c in changes if c.result == label]) for label in labels]


def _changes(changes: Sequence[Change]) -> Iterator[Row]:
    """Yield a row for each change of ERR, and of final masks for the other rates, too."""
    for change, above in zip(changes, (None, *changes), strict=False):
        rates = [*SHORT] if change.final else [TESTED]
        for rate in rates:
            first, told = rate == rates[0], change.difference[rate]
            yield Row(
                [
                    change.variant if first and _begins(change, above) else "",
                    change.stage if first else "",
                    rate,
                    percent(change.base[rate]),
                    percent(change.new[rate]),
                    points(told.mean),
                    marked(told),
                ],
                bold=change.final and first,
                ends=change.final and rate == rates[-1],
            )


def _levels(changes: Sequence[Change]) -> Iterator[Row]:
    for change, above in zip(changes, (None, *changes), strict=False):
        yield Row(
            [
                change.variant if _begins(change, above) else "",
                change.stage,
                str(change.frames),
                *(percent(change.new[rate]) for rate in SHORT),
            ],
            ends=change.final,
        )


def _begins(change: Change, above: Change | None) -> bool:
    return above is None or above.variant != change.variant


def _show_drives(comparison: Comparison, out: Console) -> None:
    """Print the drives that changed, the surest first."""
    changed = [row for row in comparison.drives if row.changed]
    for mask in dict.fromkeys((row.result, row.variant) for row in changed):
        rows = [row for row in changed if (row.result, row.variant) == mask]
        out.print(f"Drives on which {mask[1]} of {mask[0]} changed", soft_wrap=True)
        tables.show(("drive",), (*CHANGE, "q"), [_drive(row) for row in rows[:DRIVES]], out)
        if len(rows) > DRIVES:
            out.print(f"and {len(rows) - DRIVES} more; --json and -o name them all")
        out.print()


def _drive(row: DriveChange) -> Row:
    told = row.difference
    assert row.q is not None
    return Row(
        [
            row.drive,
            percent(row.base),
            percent(row.new),
            points(told.mean),
            interval(told.low, told.high),
            "<0.001" if row.q < 0.001 else f"{row.q:.3f}",
        ]
    )
