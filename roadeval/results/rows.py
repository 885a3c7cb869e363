"""Rows of the tables, typed as they are counted, and their text in CSV.

Numbers are written so that they read back the same. An undefined rate is an empty cell.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from itertools import combinations
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from roadeval.data import Doubt, Frame, FrameResult, Rows, Tally
from roadeval.evaluation.regions import ALL
from roadeval.evaluation.score import SIGNS, Camera, at_levels, windows
from roadeval.results.schema import DAMAGED, KEY, SCORED, TABLES, TYPES, UNSCORED
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from roadeval.evaluation.score import Scoreboard
    from roadeval.results.facts import Facts

Row = tuple[Any, ...]
"""A row's cells in the order of its table's columns, without the key."""
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
    frame, tallies = result.frame, result.tallies
    number, finals = frame.number, {tally.variant: tally.stage for tally in tallies}
    when = number, frame.stamp_ns, frame.log_time_ns
    truth = result.truth_bits.checksum() if result.truth_bits else 0
    return {
        "frames": [(*when, each.variant, each.stage, *_numbers(each), truth) for each in tallies],
        "regions": [
            (number, each.variant, each.stage, region, *counts, counts.n)
            for each in tallies
            for region, counts in each.regions.items()
        ],
        "oracles": [
            (number, each.variant, oracle, each.stage, *_numbers(each))
            for oracle, own in result.oracles.items()
            for each in own
        ],
        "disagreements": [
            (number, one[0], other[0], *result.changes[*one, *other])
            for one, other in combinations(finals.items(), 2)
        ],
        "edges": [
            (
                *(number, variant, finals[variant], measure, f"{at}m" if at else "ahead"),
                *(round(end, 3) for end in ends),
            )
            for variant, own in result.metres.items()
            for (measure, at), ends in zip(own.measures, own.ends[0].tolist(), strict=True)
        ],
    }


def _numbers(tally: Tally) -> Row:
    return *tally.counts, tally.counts.n, *tally.rates.values()


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
        columns = np.column_stack((levels, road[levels], other[levels]))
        probabilities += [(*name, *row) for row in columns.tolist()]
    return {
        "windows": [tuple(row.values()) for row in board.windows()],
        "changes": [(*step, *change) for step, change in board.changes.items()],
        "heat": heat,
        "probabilities": probabilities,
        "metres": [tuple(row.values()) for row in board.metres()],
    }


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
    pairs = zip(columns, cells, strict=True)
    return Rows({column.name: np.array(each, TYPES[column.kind]) for column, each in pairs})


def window_table(masks: Camera, size: int) -> Rows:
    """Return the rows of ``windows`` of so many frames, see `roadeval.evaluation.score.windows`."""
    return as_arrays("windows", (tuple(row.values()) for row in windows(masks, size)))


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
        "misfits": "\n".join(facts.misfits) or None,
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
                **beyond,
                "boundary_f": beyond.get("boundary_F"),
                "boundary_iou": beyond.get("boundary_IoU"),
                "episodes": beyond.get("episodes", {}).get("episodes"),
                "episode_seconds": beyond.get("episodes", {}).get("seconds"),
            }
            yield {**mask, "region": ALL, **(further if final else {}), **total}
            for (name, after, region), sums in regions.items():
                if (name, after) == (variant, stage):
                    yield {**mask, "region": region, **sums}


def effect_rows(facts: Facts) -> Iterator[dict[str, Any]]:
    """Yield the rows of ``effects``: each variant minus ``unfiltered``, and minus ``blind``."""
    for each in facts.effects:
        mask = {"base": each.base, "variant": each.variant, "stage": each.stage}
        for metric, found in each.rates.items():
            frames = {"frames": found.units, "effective_frames": found.effective}
            yield {**mask, "final": each.final, "metric": metric, **asdict(found), **frames}


def cells(table: str, key: Key, rows: Iterable[Mapping[str, Any]]) -> list[list[Any]]:
    """Put rows into the order of a table's columns, with their key; what a row lacks is None."""
    names = TABLES[table].names
    own = key._asdict()
    return [[own.get(name, row.get(name)) for name in names] for row in rows]
