"""Figures: a name, a caption, and a pure function that draws a run's results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import Mask, Rgb, Rows, Truth
from roadeval.report.chart import Chart
from roadeval.report.images import shrink
from roadeval.runtime.discovery import found_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXAMPLE_WIDTH: Final = 400
"""Pixels across an example's picture, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class ExampleFrame:
    """A frame to show: its image, its truth if it has one, and the final masks of variants.

    A variant whose masks another system has made may have none. ``image`` is ``(H, W, 3)`` uint8
    RGB, ``truth`` ``(H, W)`` uint8 (0, 1, 255) and each of ``masks``, by variant, ``(H, W)`` uint8
    (0, 1).
    """

    frame: int
    image: Rgb
    truth: Truth | None
    masks: Mapping[str, Mask]

    def small(self) -> ExampleFrame:
        """Return the example in the size in which it is drawn, of which a run can hold a few."""
        return ExampleFrame(
            self.frame,
            shrink(self.image, EXAMPLE_WIDTH),
            None if self.truth is None else shrink(self.truth, EXAMPLE_WIDTH, labels=True),
            {name: shrink(mask, EXAMPLE_WIDTH, labels=True) for name, mask in self.masks.items()},
        )


def variants_of(examples: Sequence[ExampleFrame]) -> list[str]:
    """Return the variants that have a mask of one of the frames."""
    return list(dict.fromkeys(name for example in examples for name in example.masks))


@dataclass(frozen=True, slots=True, eq=False)
class ThresholdData:
    """What is known of probabilities of road.

    Parameters
    ----------
    levels
        As ``probabilities.csv``.
    quoted
        As ``curves`` in ``summary.json``.
    totals
        As ``totals`` there: every variant.
    """

    levels: Rows
    quoted: Mapping[str, Mapping[str, Mapping[str, Any]]]
    totals: Mapping[str, Mapping[str, Mapping[str, Any]]]


@dataclass(frozen=True, slots=True, eq=False)
class FigureData:
    """The results that figures are drawn from.

    Parameters
    ----------
    drive
        Its name, for titles.
    windows
        As ``windows.csv``, any number of variants; no row without truth.
    examples
        A few frames.
    thresholds
        Of variants that say how probable road is; None where nobody asks for it.
    """

    drive: str
    windows: Rows
    examples: Sequence[ExampleFrame] = field(default=())
    thresholds: ThresholdData | None = None


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """A figure.

    Parameters
    ----------
    name
        Of its files, without the ending.
    caption
        A sentence to be printed below it.
    draw
        Draws it; returns None where the data has nothing to draw.
    in_report
        Whether the report of a drive shows it, too.
    charts
        Returns the same as charts, for a page that shows values; none by default.
    """

    name: str
    caption: str
    draw: Callable[[FigureData], Figure | None]
    in_report: bool = False
    charts: Callable[[FigureData], Sequence[Chart]] = lambda _data: ()


def figures() -> tuple[FigureSpec, ...]:
    """Return the figures of this folder, in the order of the files' names."""
    from roadeval.report import figures as folder

    return found_in(folder, "FIGURE")
