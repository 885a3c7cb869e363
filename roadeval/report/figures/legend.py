"""Legends that are as many lines high as their names ask, so that none leaves the figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.report.figures.layout import EDGE, INCH, LETTERS, fitting, width_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROW: Final = 15
"""Points from one line of a legend to the next."""
PAD: Final = 0.8
"""Letters from a legend's line to its label."""


@dataclass(frozen=True, slots=True)
class LegendStyle:
    """The length of a legend's lines, and the distance of its columns, in letters.

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
            "handletextpad": PAD,
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
        return LETTERS * (self.handlelength + PAD)

    def _columns(self, labels: Sequence[str], room: float) -> int:
        """Return the greatest number of columns that have room beside each other."""
        widths = [self._handle + width_of(label, LETTERS) for label in labels]
        for count in range(min(self.columns, len(labels)), 1, -1):
            columns = [part.max() for part in np.array_split(widths, count)]
            if sum(columns) + (count - 1) * LETTERS * self.columnspacing <= room:
                return count
        return 1


def room_in(width: float) -> float:
    """Return the points that a legend has in a figure of so many inches."""
    return INCH * width - 4 * EDGE


def legend(
    figure: Figure, handles: Sequence[Any], labels: Sequence[str], style: LegendStyle
) -> float:
    """Write a legend along the figure's top, in as many lines as it takes; return its points."""
    room = room_in(figure.get_figwidth())
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
    return EDGE + ROW * style.lines(labels, room)
