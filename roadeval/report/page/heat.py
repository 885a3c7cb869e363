"""Heat maps with the numbers that they show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.report.blocks import ImageFile
from roadeval.report.chart import HeatMap

STEPS: Final = 10
"""Steps of a number that is told to each unit: one place after the point."""
_UNKNOWN: Final = -1


@dataclass(frozen=True, slots=True)
class HeatDrawing:
    """A heat map as it is drawn."""

    chart: HeatMap

    @property
    def size(self) -> tuple[int, int]:
        """Cells across and down."""
        rows, columns = self.chart.values.shape
        return columns, rows

    @property
    def picture(self) -> ImageFile:
        """A pixel a cell."""
        return ImageFile(self.chart.picture)

    def values(self) -> dict[str, Any]:
        """Return the numbers row by row, in runs: how many, and which in tenths; -1: unknown."""
        values = self.chart.values
        tenths = np.rint(STEPS * np.nan_to_num(values, nan=_UNKNOWN / STEPS)).astype(int)
        return {
            "title": self.chart.title,
            "unit": self.chart.unit,
            "size": [*self.size],
            "runs": [*_runs(tenths.ravel())],
        }


def _runs(numbers: npt.NDArray[np.int_]) -> Iterator[int]:
    """Yield the length and the number of each run of equal numbers."""
    edges = np.flatnonzero(np.diff(numbers)) + 1
    for start, end in zip([0, *edges.tolist()], [*edges.tolist(), len(numbers)], strict=True):
        yield end - start
        yield int(numbers[start])
