"""The tables' columns and lines. Numbers are written so that they read back the same.

An undefined rate is an empty cell. No cell needs quoting: variant, stage and region names hold no
comma.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final

from roadeval.data import Counts, Frame, Tally
from roadeval.evaluation.maps import Maps
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.windows import Window

COUNT_COLUMNS: Final = ("TP", "TN", "FP", "FN", "N")
COLUMNS: Final[dict[str, tuple[str, ...]]] = {
    "frames": ("frame", "stamp_ns", "log_time_ns", "variant", "stage", *COUNT_COLUMNS, *METRICS),
    "regions": ("frame", "variant", "stage", "region", *COUNT_COLUMNS),
    "windows": (
        *("window", "first_frame", "last_frame", "frames", "variant", "stage"),
        *METRICS,
        *(f"pooled_{name}" for name in METRICS),
    ),
    "oracles": ("frame", "variant", "oracle", "stage", *COUNT_COLUMNS, *METRICS),
    "changes": (
        *("from_variant", "from_stage", "to_variant", "to_stage"),
        *("repaired", "spoiled", "N"),
    ),
    "heat": ("variant", "top", "left", "side", "labelled", "FP", "FN"),
}
"""The columns of each table, by its name; the file is ``<name>.csv``.

``oracles``: a row per evaluated frame, variant, stage replaced by the truth (``oracle``), and
stage after it. ``changes``: pixels of the drive that one mask has right and the one before wrong
(``repaired``), and the reverse. ``heat``: a row per variant and square cell of the image of
``side`` pixels from row ``top`` and column ``left``: how often a pixel of it was labelled, and was
a false positive or negative in the final mask. The last two are sums over the drive.
"""


def header(table: str) -> str:
    """Give a table's first line."""
    return _line(COLUMNS[table])


def frame_lines(frame: Frame, tallies: Iterable[Tally]) -> str:
    """Write a frame's lines of ``frames.csv``."""
    times = f"{frame.number},{frame.stamp_ns},{frame.log_time_ns}"
    return "".join(
        f"{times},{tally.variant},{tally.stage},{_counts(tally.counts)},{_rates(tally)}\n"
        for tally in tallies
    )


def region_lines(frame: Frame, tallies: Iterable[Tally]) -> str:
    """Write a frame's lines of ``regions.csv``."""
    return "".join(
        f"{frame.number},{tally.variant},{tally.stage},{region},{_counts(counts)}\n"
        for tally in tallies
        for region, counts in tally.regions.items()
    )


def oracle_lines(frame: Frame, oracles: Mapping[str, Iterable[Tally]]) -> str:
    """Write a frame's lines of ``oracles.csv``."""
    return "".join(
        f"{frame.number},{tally.variant},{oracle},{tally.stage},"
        f"{_counts(tally.counts)},{_rates(tally)}\n"
        for oracle, tallies in oracles.items()
        for tally in tallies
    )


def change_lines(maps: Maps) -> str:
    """Write the lines of ``changes.csv``."""
    return "".join(
        _line((*step, change.repaired, change.spoiled, change.labelled))
        for step, change in maps.changes.items()
    )


def heat_lines(maps: Maps) -> str:
    """Write the lines of ``heat.csv``, without cells that are never labelled."""
    lines = []
    for variant, heat in maps.heat.items():
        side, sums = heat.cells()
        for row, column in zip(*sums[0].nonzero(), strict=True):
            place = int(row) * side, int(column) * side
            lines.append(_line((variant, *place, side, *sums[:, row, column].tolist())))
    return "".join(lines)


def window_lines(windows: Iterable[Window]) -> str:
    """Write the lines of ``windows.csv``."""
    return "".join(
        _line(
            (
                *(row.number, row.first_frame, row.last_frame, row.frames, row.variant, row.stage),
                *row.rates.values(),
                *row.pooled.values(),
            )
        )
        for row in windows
    )


def _counts(counts: Counts) -> str:
    return f"{counts.tp},{counts.tn},{counts.fp},{counts.fn},{counts.n}"


def _rates(tally: Tally) -> str:
    return ",".join(map(_cell, tally.rates.values()))


def _line(cells: Iterable[str | int | float]) -> str:
    return ",".join(map(_cell, cells)) + "\n"


def _cell(value: str | int | float) -> str:
    """Write a cell: the shortest decimal that reads back as the same number."""
    return "" if isinstance(value, float) and math.isnan(value) else str(value)
