"""Rows of the tables, typed as they are counted, and their text in CSV.

Numbers are written so that they read back the same. An undefined rate is an empty cell.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import astuple
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from roadeval.data import Change, Counts, Doubt, Frame, FrameResult, Rows, Transition
from roadeval.evaluation.regions import ALL
from roadeval.evaluation.score import SIGNS, at_levels
from roadeval.results.schema import DAMAGED, KEY, SCORED, TABLES, UNSCORED, Kind
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from roadeval.evaluation.score import Scoreboard, Window
    from roadeval.results.facts import Facts

Row = tuple[str | int | float, ...]
"""A row's cells in the order of its table's columns, without the key."""
ARRAYS: Final = {
    **dict.fromkeys((Kind.NAME, Kind.TEXT), "str"),
    **dict.fromkeys((Kind.COUNT, Kind.TIME), "int64"),
    **dict.fromkeys((Kind.RATE, Kind.NUMBER), "float64"),
    Kind.FLAG: "bool",
}
"""The NumPy type of each kind of column."""


LOST: Final = 3
"""Exit code of a replay that has lost a part of its log."""
ACCOUNT: Final = ("in_log", "read", "decoded", "labelled", "trained_on", "evaluated")


class Key(NamedTuple):
    """What every row begins with."""

    drive: str
    camera: str

    def cells(self) -> str:
        """Return both as cells of CSV, with the comma behind them."""
        texts = ((text, text.replace('"', '""')) for text in map(visible, self))
        return "".join(f'"{own}",' if set(text) & {",", '"'} else f"{text}," for text, own in texts)


def doubt_rows(frame: Frame, doubts: Iterable[Doubt]) -> dict[str, list[Row]]:
    """Return the rows of ``unlabelled`` of a frame."""
    when = frame.number, frame.stamp_ns
    rows = [(*when, e.variant, e.stage, *(getattr(e, sign) for sign in SIGNS)) for e in doubts]
    return {"unlabelled": rows}


def frame_rows(result: FrameResult) -> dict[str, list[Row]]:
    """Return a frame's rows of each table of evaluated frames; empty for others."""
    frame = result.frame
    return {
        "frames": [
            (
                *(frame.number, frame.stamp_ns, frame.log_time_ns, tally.variant, tally.stage),
                *(*_counts(tally.counts), *tally.rates.values()),
            )
            for tally in result.tallies
        ],
        "regions": [
            (frame.number, tally.variant, tally.stage, region, *_counts(counts))
            for tally in result.tallies
            for region, counts in tally.regions.items()
        ],
        "oracles": [
            (
                *(frame.number, tally.variant, oracle, tally.stage),
                *(*_counts(tally.counts), *tally.rates.values()),
            )
            for oracle, tallies in result.oracles.items()
            for tally in tallies
        ],
        "disagreements": [
            (frame.number, one, other, change.repaired, change.spoiled, change.labelled)
            for one, other, change in _pairs(result.changes)
        ],
        "edges": [*_edges(result)],
    }


def _edges(result: FrameResult) -> Iterator[Row]:
    """Yield the rows of ``edges``: where masks end, and where the truth does."""
    stages = {tally.variant: tally.stage for tally in result.tallies}
    for variant, own in result.metres.items():
        for (measure, at), (mask, truth) in zip(own.measures, own.ends[0].tolist(), strict=True):
            where = f"{at}m" if at else "ahead"
            ends = round(mask, 3), round(truth, 3)
            yield (result.frame.number, variant, stages[variant], measure, where, *ends)


def _pairs(changes: Mapping[Transition, Change]) -> Iterator[tuple[str, str, Change]]:
    """Yield each pair of variants once, with how their final masks differ."""
    seen: set[str] = set()
    for (one, _, other, _), change in changes.items():
        if one == other:
            continue
        seen.add(one)
        if other not in seen:
            yield one, other, change


def sum_rows(board: Scoreboard) -> dict[str, list[Row]]:
    """Return the rows of each table of sums over the drive.

    Cells of heat maps that are never labelled, and levels of probabilities that do not occur, have
    none.
    """
    heat: list[Row] = []
    for variant, each in board.heat.items():
        side, sums = each.cells()
        tops, lefts = sums[0].nonzero()
        cells = (tops * side, lefts * side, np.full_like(tops, side), *sums[:, tops, lefts])
        heat += [(variant, *cell) for cell in np.column_stack(cells).tolist()]
    probabilities: list[Row] = []
    for name, counts in board.curves.counts.items():
        other, road = at_levels(counts)
        levels = (other + road).nonzero()[0]
        columns = (each[levels].tolist() for each in (road, other))
        rows = zip(levels.tolist(), *columns, strict=True)
        probabilities += [(*name, *row) for row in rows]
    return {
        "windows": window_rows(board.windows()),
        "changes": [
            (*step, change.repaired, change.spoiled, change.labelled)
            for step, change in board.changes.items()
        ],
        "heat": heat,
        "probabilities": probabilities,
        "metres": [astuple(each) for each in board.metres()],
    }


def window_rows(windows: Iterable[Window]) -> list[Row]:
    """Return the rows of ``windows``."""
    return [
        (
            *(each.number, each.first_frame, each.last_frame, each.frames),
            *(each.variant, each.stage),
            *each.rates.values(),
            *each.pooled.values(),
        )
        for each in windows
    ]


def _counts(counts: Counts) -> tuple[int, ...]:
    return counts.tp, counts.tn, counts.fp, counts.fn, counts.n


def csv_lines(key: Key, rows: Mapping[str, Iterable[Row]]) -> dict[str, str]:
    """Return the lines of CSV of tables that have rows."""
    start = key.cells()
    texts = {
        name: "".join(f"{start}{','.join(map(_cell, row))}\n" for row in own)
        for name, own in rows.items()
    }
    return {name: text for name, text in texts.items() if text}


def _cell(value: str | int | float) -> str:
    """Return the shortest decimal that reads back as the same number."""
    return "" if isinstance(value, float) and math.isnan(value) else str(value)


def as_arrays(name: str, rows: Iterable[Row]) -> Rows:
    """Return rows of a table as arrays, without the key."""
    columns = TABLES[name].columns[len(KEY) :]
    cells = [*zip(*rows, strict=True)] or [()] * len(columns)
    return Rows(
        {
            column.name: np.array(each, ARRAYS[column.kind])
            for column, each in zip(columns, cells, strict=True)
        }
    )


def drive_row(facts: Facts, name: str, source: str) -> dict[str, Any]:
    """Return the row of ``drives`` of a drive that was replayed, under a name, from a source."""
    status = (DAMAGED if facts.losses else SCORED) if facts.totals else UNSCORED
    return {
        "name": name,
        "source": source,
        "status": status,
        "exit_code": LOST if facts.losses else 0,
        "reason": None if facts.totals else next(iter(facts.warnings), None),
        "log_digest": facts.log_digest,
        **{column: getattr(facts.drive, column) for column in ("rate_hz", "width", "height")},
        **{column: getattr(facts.frames, column) for column in ACCOUNT},
        "losses": "\n".join(facts.losses) or None,
        "warnings": "\n".join(facts.warnings) or None,
        "verdict": facts.verdict,
    }


def score_rows(
    facts: Facts, regions: Mapping[tuple[str, str, str], Mapping[str, Any]]
) -> Iterator[dict[str, Any]]:
    """Yield the rows of ``scores``: each mask on every labelled pixel, then region by region.

    ``regions`` has frames, counts and rates by variant, stage and region.
    """
    for variant, own in facts.totals.items():
        beyond = facts.beyond.get(variant, {})
        for stage, total in own.items():
            final = facts.finals[variant] == stage
            mask = {"variant": variant, "stage": stage, "final": final}
            further = {
                "boundary_f": beyond.get("boundary_F"),
                "boundary_iou": beyond.get("boundary_IoU"),
                "episodes": beyond.get("episodes", {}).get("episodes"),
                "episode_seconds": beyond.get("episodes", {}).get("seconds"),
                "flicker": beyond.get("flicker"),
                "truth_flicker": beyond.get("truth_flicker"),
            }
            yield {**mask, "region": ALL, **total, **(further if final else {})}
            for (name, after, region), sums in regions.items():
                if (name, after) == (variant, stage):
                    yield {**mask, "region": region, **sums}


def effect_rows(facts: Facts) -> Iterator[dict[str, Any]]:
    """Yield the rows of ``effects``: each variant minus ``unfiltered``, and minus ``blind``."""
    for each in facts.effects:
        for metric, found in each.rates.items():
            yield {
                "base": each.base,
                "variant": each.variant,
                "stage": each.stage,
                "final": each.final,
                "metric": metric,
                "mean": found.mean,
                "standard_error": found.standard_error,
                "low": found.low,
                "high": found.high,
                "p": found.p,
                "frames": found.units,
                "effective_frames": found.effective,
                "worse": found.worse,
                "better": found.better,
            }


def cells(table: str, key: Key, rows: Iterable[Mapping[str, Any]]) -> list[list[Any]]:
    """Put rows into the order of a table's columns, with their key; what a row lacks is None."""
    names = TABLES[table].names
    own = key._asdict()
    return [[own.get(name, row.get(name)) for name in names] for row in rows]
