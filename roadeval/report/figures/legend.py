"""Legends that are as many lines high as their names ask, so that none leaves the figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.report.figures.layout import EDGE, INCH, LETTERS, fitting, width_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINE: Final = 15
"""Points from one line of a legend to the next."""


@dataclass(frozen=True, slots=True)
class LegendStyle:
    """How a legend is set: the lengths of its lines and the distances of its columns, in letters.

    ``columns`` is how many there are at most.
    """

    columns: int = 6
    handlelength: float = 3.2
    columnspacing: float = 2.0

    def arguments(self, labels: Sequence[str], room: float) -> dict[str, Any]:
        """Return Matplotlib's arguments for a legend of these labels, ``room`` points wide."""
        return {
            "ncols": self._columns(labels, room),
            "handlelength": self.handlelength,
            "columnspacing": self.columnspacing,
        }

    def lines(self, labels: Sequence[str], room: float) -> int:
        """Return the number of lines that a legend of these labels has."""
        return -(-len(labels) // self._columns(labels, room))

    def short(self, labels: Sequence[str], room: float) -> list[str]:
        """Return the labels, shortened where one alone has no room."""
        return [fitting(label, room - self._handle, LETTERS) for label in labels]

    @property
    def _handle(self) -> float:
        """Points from the beginning of a line to its label."""
        return LETTERS * (self.handlelength + 0.8)

    def _columns(self, labels: Sequence[str], room: float) -> int:
        """Return the greatest number of columns that have room beside each other."""
        widths = [self._handle + width_of(label, LETTERS) for label in labels]
        for count in range(min(self.columns, len(labels)), 1, -1):
            columns = [part.max() for part in np.array_split(widths, count)]
            if sum(columns) + (count - 1) * LETTERS * self.columnspacing <= room:
                return count
        return 1


def legend(
    figure: Figure, handles: Sequence[Any], labels: Sequence[str], style: LegendStyle
) -> float:
    """Write a legend along the figure's top, in as many lines as it takes; return its points."""
    room = INCH * figure.get_figwidth() - 3 * EDGE
    labels = style.short(labels, room)
    figure.legend(
        handles,
        labels,
        loc="upper left",
        bbox_to_anchor=(0, 1),
        borderaxespad=0,
        borderpad=EDGE / LETTERS,
        **style.arguments(labels, room),
    )
    return EDGE + LINE * style.lines(labels, room)
