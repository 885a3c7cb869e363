"""The report of a comparison: as a document with figures, and as Markdown for a pull request."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from typing import Final

from roadeval.data import Rows
from roadeval.data.words import listing, number, percent, points, timestamp
from roadeval.evaluation.comparison_result import Comparison, MaskComparison
from roadeval.evaluation.conditions import Judgement
from roadeval.evaluation.metrics import SHORT, SHORT_OVERLAP
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
from roadeval.report.charts import differences, rates
from roadeval.report.comparison_rows import breaks, interval_of, named, naming_columns
from roadeval.report.comparison_where import disagreement_table, where
from roadeval.report.markdown import table as markdown_table
from roadeval.results.certainty import correction, too_few
from roadeval.results.comparison import judged, verdict, warnings
from roadeval.results.comparison import where as told_where
from roadeval.runtime.text import as_markdown

Inspect = Callable[[str, int], str]
_COMMAND: Final = ("in the viewer",)
OTHERS: Final = tuple(name for name in SHORT if name != "ERR")
"""The rates of short tables without ERR, which has columns of its own."""


def document(
    comparison: Comparison,
    judgements: Sequence[Judgement],
    windows: Rows,
    inspect: Inspect | None = None,
) -> Document:
    """Return a comparison as a document.

    Parameters
    ----------
    comparison
        The comparison.
    judgements
        Of the limits that were set.
    windows
        The rows over the drive, with each result as a variant; may be empty.
    inspect
        Returns the command that opens a frame of a result, by its label; None: no commands.
    """
    labels = [each.label for each in comparison.results]
    return Document(
        kicker="roadeval comparison",
        title=listing(labels),
        subtitle="; ".join(
            f"{each.label}: {each.frames} frames of {each.drive}" for each in comparison.results
        ),
        footer=f"comparison of {listing(labels)}",
        blocks=list(_blocks(comparison, judgements, windows, inspect)),
        keywords=["road recognition", "comparison"],
    )


def markdown(comparison: Comparison, judgements: Sequence[Judgement]) -> str:
    """Return a comparison as Markdown."""
    lines = ["# roadeval comparison", "", as_markdown(verdict(comparison)), ""]
    lines += [
        f"- {'**FAIL**' if each.holds else 'ok'}: {as_markdown(judged(each))}"
        for each in judgements
    ]
    lines += ["", *markdown_table(_rates_table(comparison)), ""]
    lines += [line for legend in _legend(comparison) for line in (as_markdown(legend), "")]
    lines += [*(f"- {as_markdown(sentence)}" for sentence in told_where(comparison)), ""]
    if comparison.disagreements:
        table = disagreement_table(comparison)
        lines += ["Frames on which they disagree most:", "", *markdown_table(table), ""]
    if comparison.moved:
        lines += ["Frames that changed most:", "", *markdown_table(_moved_table(comparison)), ""]
    lines += [f"- {as_markdown(warning)}" for warning in warnings(comparison)]
    lines += ["", _unit(comparison)]
    return "\n".join(lines).rstrip() + "\n"


def _blocks(
    comparison: Comparison,
    judgements: Sequence[Judgement],
    windows: Rows,
    inspect: Inspect | None,
) -> Iterator[Block]:
    yield Heading("What changed")
    yield Text(verdict(comparison), "verdict")
    yield from _limits(judgements)
    yield _rates_table(comparison)
    yield Text(_unit(comparison), "note")
    yield from (Text(legend, "note") for legend in _legend(comparison))
    yield from _why_nointerval_of(comparison.changes)
    if comparison.notes:
        yield BulletList("Beware", warnings(comparison), "warning")
    yield TableOfContents(depth=2)
    finals = [row for row in comparison.changes if row.final]
    if comparison.same_drive:
        yield Figure(
            differences.changes(finals), "Change of the final mask's rates against the base."
        )
        if charts := rates.over_windows(windows, ["ERR"]):
            yield Heading("Over the drive", 2)
            yield Figure(charts, "ERR of the final masks over the common frames.")
    else:
        yield Figure(differences.levels(finals), "Rates of the final masks.")
    yield from where(comparison)
    if comparison.moved:
        yield Heading("Frames that changed most", 2)
        yield _moved_table(comparison, inspect)


def _legend(comparison: Comparison) -> Iterator[str]:
    """Yield what the mark in the table means, where something was corrected."""
    changes = [row.difference["ERR"] for row in comparison.changes if row.difference]
    if legend := correction(map(asdict, changes)):
        yield legend


def _limits(judgements: Sequence[Judgement]) -> Iterator[Block]:
    failed = [judged(each) for each in judgements if each.holds]
    kept = [judged(each) for each in judgements if not each.holds]
    if failed:
        yield BulletList("Limits exceeded", failed, "warning")
    if kept:
        yield BulletList("Limits kept", kept)


def _unit(comparison: Comparison) -> str:
    if not comparison.same_drive:
        return "Percent over each result's own frames."
    return (
        "Percent over the frames that both evaluated; differences are new minus base, in "
        "percentage points."
    )


# --- Tables ---------------------------------------------------------------------------------------


def _rates_table(comparison: Comparison) -> Table:
    """Tabulate the rates of every result, variant and stage, and on one drive their changes."""
    rows = comparison.changes
    return _changes_table(rows) if comparison.same_drive else _levels_table(rows)


def _changes_table(rows: Sequence[MaskComparison]) -> Table:
    names = naming_columns(rows)
    return Table(
        [*names, "stage", "base", "new", "difference", "interval", *OTHERS],
        [
            [
                *named(row, names),
                row.stage,
                percent(row.base["ERR"]),
                percent(row.new["ERR"]),
                Cell(points(row.difference["ERR"].mean), bold=row.final),
                interval_of(row.difference["ERR"]),
                *(points(row.new[rate] - row.base[rate]) for rate in OTHERS),
            ]
            for row in rows
        ],
        text_columns=range(len(names) + 1),
        breaks=breaks(rows),
        groups=[("", len(names) + 1), ("ERR", 4), ("difference", len(OTHERS))],
        small=True,
    )


def _levels_table(rows: Sequence[MaskComparison]) -> Table:
    rates = (*SHORT, *SHORT_OVERLAP)
    return Table(
        ["result", "variant", "stage", "frames", *rates],
        [
            [
                *(row.result, row.variant, row.stage),
                number(row.frames),
                *(percent(row.new[rate]) for rate in rates),
            ]
            for row in rows
        ],
        text_columns=range(3),
        breaks=breaks(rows),
        small=True,
    )


def _moved_table(comparison: Comparison, inspect: Inspect | None = None) -> Table:
    """Tabulate the frames whose error rate changed most, with what opens each of the new result."""
    rows = comparison.moved
    names = naming_columns(rows)
    return Table(
        [*names, "frame", "stamp", "ERR base", "new", "difference", *_COMMAND[: bool(inspect)]],
        [
            [
                *named(row, names),
                str(row.frame),
                timestamp(row.stamp_ns),
                percent(row.base),
                percent(row.new),
                Cell(points(row.change), bold=True),
                *([inspect(row.result, row.frame)] if inspect else []),
            ]
            for row in rows
        ],
        text_columns=[*range(len(names)), len(names) + 1, len(names) + 5],
        breaks=breaks(rows),
        small=True,
    )


# --- Sentences ------------------------------------------------------------------------------------


def _why_nointerval_of(rows: Sequence[MaskComparison]) -> Iterator[Text]:
    """Yield the reason why there is no interval, once for each result and variant."""
    reasons = [
        f"{_name(row)}: no interval for ERR, because {too_few(change.frames)}."
        for row in rows
        if row.final and (change := row.difference.get("ERR")) and change.low is None
    ]
    yield from (Text(reason, "note") for reason in dict.fromkeys(reasons))


def _name(row: MaskComparison) -> str:
    same = row.result == row.variant
    return row.result if same else f"{row.result}, {row.variant}"
