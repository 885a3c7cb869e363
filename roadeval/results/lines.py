"""Rows of the tables, and their lines of CSV. Numbers are written so that they read back the same.

An undefined rate is an empty cell. No cell needs quoting: variant, stage and region names hold no
comma.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Change, Counts, FrameResult, Tally, Transition
from roadeval.evaluation.maps import HeatMap, Name
from roadeval.evaluation.scoreboard import DriveSums
from roadeval.evaluation.thresholds import Sums, at_levels
from roadeval.evaluation.windows import Window

Row = tuple[str | int | float, ...]
"""A row's cells in the order of the table's columns."""
_CELL: Final = "%d,%d,%d,%d,%d,%d\n"
"""A line of ``heat.csv``, after the variant."""


def lines(result: FrameResult) -> dict[str, str]:
    """Return a frame's lines of each table that grows frame by frame; none if it is not evaluated.

    They are written out, cell by cell, for there are hundreds a frame.
    """
    frame = result.frame
    times = f"{frame.number},{frame.stamp_ns},{frame.log_time_ns}"
    texts = {
        "frames": "".join(
            f"{times},{tally.variant},{tally.stage},{_counts(tally.counts)},{_rates(tally)}\n"
            for tally in result.tallies
        ),
        "regions": "".join(
            f"{frame.number},{tally.variant},{tally.stage},{region},{_counts(counts)}\n"
            for tally in result.tallies
            for region, counts in tally.regions.items()
        ),
        "oracles": "".join(
            f"{frame.number},{tally.variant},{oracle},{tally.stage},"
            f"{_counts(tally.counts)},{_rates(tally)}\n"
            for oracle, tallies in result.oracles.items()
            for tally in tallies
        ),
        "disagreements": "".join(
            f"{frame.number},{one},{other},{change.repaired},{change.spoiled},{change.labelled}\n"
            for one, other, change in _pairs(result.changes)
        ),
    }
    return {name: text for name, text in texts.items() if text}


def _pairs(changes: Mapping[Transition, Change]) -> Iterator[tuple[str, str, Change]]:
    """Yield each pair of variants once, with what their final masks differ in."""
    seen: set[str] = set()
    for (one, _, other, _), change in changes.items():
        if one == other:
            continue
        seen.add(one)
        if other not in seen:
            yield one, other, change


def sum_lines(sums: DriveSums) -> dict[str, str]:
    """Return the lines of each table that sums up the drive; none where nothing was scored."""
    texts = {
        "windows": "".join(map(_line, window_rows(sums.windows))),
        "changes": "".join(map(_line, change_rows(sums.changes))),
        "heat": "".join(_heat_lines(sums.heat)),
        "probabilities": "".join(map(_line, probability_rows(sums.probabilities))),
    }
    return {name: text for name, text in texts.items() if text}


def window_rows(windows: Iterable[Window]) -> Iterator[Row]:
    """Yield the rows of ``windows.csv``."""
    for row in windows:
        yield (
            *(row.number, row.first_frame, row.last_frame, row.frames, row.variant, row.stage),
            *row.rates.values(),
            *row.pooled.values(),
        )


def change_rows(changes: Mapping[Transition, Change]) -> Iterator[Row]:
    """Yield the rows of ``changes.csv``."""
    for step, change in changes.items():
        yield (*step, change.repaired, change.spoiled, change.labelled)


def heat_rows(heat: Mapping[str, HeatMap]) -> Iterator[Row]:
    """Yield the rows of ``heat.csv``, without cells that are never labelled."""
    for variant, each in heat.items():
        for cell in _cells(each).tolist():
            yield (variant, *cell)


def _heat_lines(heat: Mapping[str, HeatMap]) -> Iterator[str]:
    """Yield the lines of `heat_rows`, all of a variant at once: there are tens of thousands."""
    for variant, each in heat.items():
        cells = _cells(each)
        yield f"{variant},{_CELL}" * len(cells) % tuple(cells.ravel().tolist())


def _cells(heat: HeatMap) -> npt.NDArray[np.int64]:
    """Return top, left, side, labelled, FP and FN of the cells that are ever labelled, (n, 6)."""
    side, sums = heat.cells()
    rows, columns = sums[0].nonzero()
    sides = np.full_like(rows, side)
    return np.column_stack((rows * side, columns * side, sides, *sums[:, rows, columns]))


def probability_rows(found: Mapping[Name, Sums]) -> Iterator[Row]:
    """Yield the rows of ``probabilities.csv``, without levels that do not occur."""
    for name, counts in found.items():
        other, road = at_levels(counts)
        for level in (other + road).nonzero()[0].tolist():
            yield (*name, level, int(road[level]), int(other[level]))


def _counts(counts: Counts) -> str:
    return f"{counts.tp},{counts.tn},{counts.fp},{counts.fn},{counts.n}"


def _rates(tally: Tally) -> str:
    return ",".join(map(_cell, tally.rates.values()))


def _line(cells: Iterable[str | int | float]) -> str:
    return ",".join(map(_cell, cells)) + "\n"


def _cell(value: str | int | float) -> str:
    """Write a cell: the shortest decimal that reads back as the same number."""
    return "" if isinstance(value, float) and math.isnan(value) else str(value)
