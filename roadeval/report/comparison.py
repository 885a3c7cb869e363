"""The report of a comparison: for a terminal, a pull request (Markdown), paper and a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from itertools import groupby, pairwise
from typing import Any, Final

from roadeval.data.words import DASH, interval, listing, number, percent, points, timestamp
from roadeval.evaluation.comparison.compare import (
    Change,
    ComparedResult,
    Comparison,
    DriveChange,
    RegionChange,
)
from roadeval.evaluation.comparison.conditions import Judgement
from roadeval.evaluation.comparison.pairing import MovedFrame
from roadeval.evaluation.metrics import SHORT, TESTED
from roadeval.report.blocks import (
    Block,
    BulletList,
    Cell,
    Figure,
    Heading,
    Report,
    Table,
    TableOfContents,
    Text,
)
from roadeval.report.blocks import markdown as written
from roadeval.report.chart import Chart
from roadeval.report.charts import standard as charts
from roadeval.results import comparison as told
from roadeval.results.sentences import correction, marked_interval

Inspect = Callable[[str, int], str]
Row = Change | MovedFrame | RegionChange | DriveChange
"""Something about a variant of a new result."""
Columns = dict[str, Callable[[Any], Cell | str]]
"""What a row has in each column, by their titles."""
NAMED: Final = 20
"""Drives that a table of changed ones names, of each mask."""
CHANGE: Final = ("base %", "new %", "change pp", "interval pp")
"""The titles of a change."""
_COMMAND: Final = "in the viewer"
_WORDS: Final = ("result", "variant", "stage", "rate", "drive", "region", "stamp")
"""The columns that hold words, beside the commands."""
_REGIONS: Final = (
    "ERR of the final masks, percent: means over the frames that label any of it, and over drives "
    "where there are several."
)
_SAME: Final = "Regions without any change are left out."
_LEFT_OUT: Final = (
    "A region that is not the same pixels in both, as the shadow that another filter found, is "
    "left out."
)


def document(
    comparison: Comparison,
    judgements: Sequence[Judgement],
    over_drive: Sequence[Chart],
    inspect: Inspect | None = None,
) -> Report:
    """Return a comparison as a document.

    ``judgements`` are of the limits that were set, ``over_drive`` has the rates of the masks over
    the drive, if any, and ``inspect`` returns the command that opens a frame of a result, by its
    label; None: no commands.
    """
    labels = [each.label for each in comparison.results]
    return Report(
        kicker="roadeval comparison",
        title=listing(labels),
        subtitle="; ".join(map(_about, comparison.results)),
        footer=f"comparison of {listing(labels)}",
        blocks=[
            Heading("What changed"),
            *overview(comparison, judgements),
            *_warnings(comparison),
            TableOfContents(depth=2),
            *_figures(comparison, over_drive),
            *_details(comparison, inspect),
        ],
        keywords=["road recognition", "comparison"],
    )


def markdown(comparison: Comparison, judgements: Sequence[Judgement]) -> str:
    """Return a comparison as Markdown."""
    blocks = [*overview(comparison, judgements), *_warnings(comparison), *_details(comparison)]
    title = "roadeval comparison"
    if judgements:
        title = f"roadeval: {told.headline([each.holds for each in judgements])}"
    return f"# {title}\n\n{written(blocks)}"


def _about(result: ComparedResult) -> str:
    if result.drive is not None:
        return f"{result.label}: {result.frames} frames of {result.drive}"
    return f"{result.label}: {number(result.scored)} of {number(result.drives)} drives scored"


def _warnings(comparison: Comparison) -> Iterator[Block]:
    if comparison.warnings:
        yield BulletList("Beware", comparison.warnings, "warning")


def overview(
    comparison: Comparison, judgements: Sequence[Judgement], most: int | None = None
) -> Iterator[Block]:
    """Yield what changed: limits, the verdict, settings, all rates, and where masks differ.

    ``judgements`` are of the limits that were set; at most ``most`` changed settings are named.
    """
    for title, kind, tone in (
        ("Limits exceeded", True, "warning"),
        ("Not judged", None, "warning"),
        ("Limits kept", False, "plain"),
    ):
        if lines := [told.judged(each) for each in judgements if each.holds is kind]:
            yield BulletList(title, lines, tone)
    yield Text(told.verdict(comparison), "verdict")
    yield from (Text(line) for line in told.changed_settings(comparison, most))
    yield from _changes(comparison)
    if where := told.where(comparison):
        yield BulletList("Where", where)


def _changes(comparison: Comparison) -> Iterator[Block]:
    """Yield a table a result: ERR of each stage, and every rate of final masks."""
    base = comparison.results[0].label
    alone = all(row.result == row.variant for row in comparison.changes)
    for result, rows in _by(_changed(comparison), lambda row: "" if alone else row.result):
        drives = max(row.drives for row in rows)
        over = f": {drives} drives in common" if drives > 1 else ""
        lines: list[list[Cell | str]] = []
        breaks = []
        for variant, own in _by(rows, lambda row: row.variant):
            breaks.append(len(lines))
            for row in own:
                for rate in SHORT if row.final else [TESTED]:
                    first, change = rate == TESTED, row.difference[rate]
                    lines.append(
                        [
                            variant if first and row is own[0] else "",
                            row.stage if first else "",
                            rate,
                            percent(row.base[rate]),
                            percent(row.new[rate]),
                            Cell(points(change.mean), bold=row.final and first),
                            marked_interval(change),
                        ]
                    )
        yield Table(
            ["variant", "stage", "rate", *CHANGE],
            lines,
            text_columns=(0, 1, 2),
            breaks=breaks[1:],
            caption=f"{result} against {base}{over}".strip(),
            small=True,
        )
    over = (
        "Means over the drives that both have, of the frames that both evaluated; a group of "
        "drives counts as one."
        if comparison.drives
        else "Means over the frames that both evaluated."
    )
    legend = correction(row.difference[TESTED] for row in comparison.changes)
    yield Text(f"{over} A change is new minus base.", "note")
    if legend:
        yield Text(legend, "note")


def _changed(comparison: Comparison) -> list[Change]:
    """Return what is shown of a comparison: not the variants of which no stage changed."""
    names = {(row.result, row.variant) for row in comparison.changes if not row.unchanged}
    return [row for row in comparison.changes if (row.result, row.variant) in names]


def _by(rows: Sequence[Change], key: Callable[[Change], str]) -> list[tuple[str, list[Change]]]:
    return [(name, [*own]) for name, own in groupby(rows, key)]


def _table(rows: Sequence[Row], columns: Columns, caption: str = "") -> Table:
    """Tabulate rows: what names one, without a result that says nothing new, and columns.

    A rule is drawn where another result begins.
    """
    names: Columns = {"result": lambda row: row.result, "variant": lambda row: row.variant}
    results = [row.result for row in rows]
    if len(set(results)) == 1 or all(row.result == row.variant for row in rows):
        del names["result"]
    made = names | columns
    return Table(
        [*made],
        [[cell(row) for cell in made.values()] for row in rows],
        text_columns=[p for p, title in enumerate(made) if title in (*_WORDS, _COMMAND)],
        breaks=[place for place, (a, b) in enumerate(pairwise(results), 1) if a != b],
        caption=caption,
        small=True,
    )


def _figures(comparison: Comparison, over_drive: Sequence[Chart]) -> Iterator[Block]:
    finals = [row for row in _changed(comparison) if row.final]
    if finals:
        caption = "Change of the final mask's rates against the base."
        yield Figure(charts.changes(finals), caption)
    if over_drive:
        yield Heading("Over the drive", 2)
        yield Figure(over_drive, f"{TESTED} of the final masks over the common frames.")


def _details(comparison: Comparison, inspect: Inspect | None = None) -> Iterator[Block]:
    """Yield the drives that changed, and the regions and frames in which masks differ."""
    if comparison.drives:
        yield Heading("Which drives changed")
        yield Text(told.DISCOVERY, "note")
        yield from _plot(comparison)
        yield from changed_drives(comparison)
    if comparison.regions:
        legend = correction(row.difference for row in comparison.regions)
        yield Heading("Where it is better, and where worse", 2)
        if rows := [row for row in comparison.regions if not row.difference.is_zero]:
            columns: Columns = {
                "region": lambda row: row.title,
                "frames": lambda row: str(row.frames),
                **_change(lambda row: marked_interval(row.difference)),
            }
            yield _table(rows, columns, _REGIONS)
        same = "" if len(rows) == len(comparison.regions) else _SAME
        yield Text(" ".join(filter(None, [legend, same, _LEFT_OUT])), "note")
    if comparison.moved:
        yield Heading("Frames that changed most", 2)
        columns = {
            "frame": lambda row: str(row.frame),
            "stamp": lambda row: timestamp(row.stamp_ns),
            "ERR base": lambda row: percent(row.base),
            "new": lambda row: percent(row.new),
            "difference": lambda row: Cell(points(row.change), bold=True),
        }
        if inspect:
            columns[_COMMAND] = lambda row: inspect(row.result, row.frame)
        yield _table(comparison.moved, columns)


def changed_drives(comparison: Comparison) -> Iterator[Block]:
    """Yield a table a mask of the drives that changed, the surest first."""
    for (result, variant), own in _by_mask(comparison).items():
        if rows := [row for row in own if row.changed]:
            shown = f" ({NAMED} of {len(rows)})" if len(rows) > NAMED else ""
            title = f"{variant} of {result}" if len(comparison.results) > 2 else variant
            yield Heading(f"Drives on which {title} changed{shown}, the surest first", 2)
            columns: Columns = {
                "drive": lambda row: row.drive,
                "frames": lambda row: number(row.frames),
                **_change(lambda row: interval(row.difference.low, row.difference.high)),
                "q": lambda row: _q_value(row.q),
            }
            yield _table(rows[:NAMED], columns)


def _q_value(q: float | None) -> str:
    return DASH if q is None else "<0.001" if q < 0.001 else f"{q:.3f}"


def _change(ends: Callable[[Any], str]) -> Columns:
    """Return the columns of a change of ERR, given what writes its interval."""
    cells: tuple[Callable[[Any], Cell | str], ...] = (
        lambda row: percent(row.base),
        lambda row: percent(row.new),
        lambda row: Cell(points(row.difference.mean), bold=True),
        ends,
    )
    return dict(zip(CHANGE, cells, strict=True))


def _by_mask(comparison: Comparison) -> dict[tuple[str, str], list[DriveChange]]:
    masks: dict[tuple[str, str], list[DriveChange]] = {}
    for row in comparison.drives:
        masks.setdefault((row.result, row.variant), []).append(row)
    return masks


def _plot(comparison: Comparison) -> Iterator[Block]:
    """Yield the change of the first mask on every drive."""
    import pandas as pd

    (result, variant), own = next(iter(_by_mask(comparison).items()))
    drives = [(row.drive, asdict(row.difference)) for row in own if row.difference.units]
    if drives:
        rows = pd.DataFrame([{"name": name, "group": "", **change} for name, change in drives])
        mask = result, variant, own[0].stage
        (over,) = (
            row.difference[TESTED]
            for row in comparison.changes
            if (row.result, row.variant, row.stage) == mask
        )
        yield charts.forest(rows, over, f"change of {TESTED} of {variant}")
