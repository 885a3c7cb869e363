"""How figures look: fonts, colours and the marks that tell variants apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED, colours
from roadeval.report.figures.layout import LETTERS, SMALL
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RC: Final[dict[str, Any]] = {
    "font.family": "DejaVu Sans",
    "font.size": LETTERS,
    "axes.titlesize": LETTERS,
    "axes.labelsize": LETTERS,
    "axes.edgecolor": "#666666",
    "axes.labelcolor": "#333333",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "xtick.color": "#333333",
    "ytick.color": "#333333",
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "legend.frameon": False,
    "legend.fontsize": LETTERS,
    "svg.fonttype": "none",
    "svg.hashsalt": "roadeval",
    "text.parse_math": False,  # a dollar in a name is no formula
    "savefig.facecolor": "white",
}
"""Matplotlib's settings for every figure; in an SVG, and so in a PDF, text stays text."""
INK: Final = "#222222"
FAINT: Final = "#666666"
PALE: Final = "#E3E3E3"


@dataclass(frozen=True, slots=True)
class Look:
    """How a variant is drawn: told apart by colour, by marker, and by dash.

    ``dash`` is Matplotlib's: on and off lengths, or ``"-"``; of two that overlap, the one with
    the greater ``order`` is on top.
    """

    label: str
    colour: str
    marker: str
    dash: str | tuple[int, tuple[float, ...]]
    hollow: bool = False
    width: float = 1.8
    order: int = 3

    @property
    def line(self) -> dict[str, Any]:
        """Matplotlib's arguments for its line."""
        return {"color": self.colour, "linestyle": self.dash, "linewidth": self.width}

    @property
    def mark(self) -> dict[str, Any]:
        """Matplotlib's arguments for its markers."""
        face = "white" if self.hollow else self.colour
        return {"marker": self.marker, "markerfacecolor": face}


_KNOWN: Final = {
    FILTERED: Look(
        "filtered: with the shadow filter", colours.hex_of(colours.FILTERED), "o", dash="-"
    ),
    UNFILTERED: Look(
        "unfiltered: without it",
        colours.hex_of(colours.UNFILTERED),
        "s",
        dash=(0, (5, 2)),
        hollow=True,
    ),
    BASELINE: Look(
        "blind: never looks at the image",
        colours.hex_of(colours.on_paper(colours.BLIND)),
        "x",
        dash=(0, (1, 1.4)),
        width=1.3,
        order=2,
    ),
}
_SHAPES: Final = (
    Look("", "", "^", (0, (7, 2, 1.5, 2))),
    Look("", "", "D", (0, (3, 2)), hollow=True),
    Look("", "", "v", (0, (9, 3))),
    Look("", "", "P", (0, (5, 2, 1.5, 2, 1.5, 2)), hollow=True),
    Look("", "", "X", (0, (2, 1))),
)


def looks(variants: Sequence[str]) -> dict[str, Look]:
    """Return each variant's look; those that do not come by default take turns at the others."""
    others = [name for name in variants if name not in _KNOWN]
    found = {
        name: replace(
            _SHAPES[place % len(_SHAPES)],
            label=name,
            colour=colours.hex_of(colours.on_paper(colours.EXTRA[place % len(colours.EXTRA)])),
        )
        for place, name in enumerate(others)
    }
    return {name: _KNOWN.get(name) or found[name] for name in variants}


def heading(figure: Figure, title: str, subtitle: str) -> None:
    """Write a figure's title and, smaller, what it shows, into its topmost half inch."""
    height = figure.get_figheight()
    figure.text(
        0.012, 1 - 0.10 / height, visible(title), size=11, weight="bold", color=INK, va="top"
    )
    figure.text(0.012, 1 - 0.32 / height, subtitle, size=8.5, color=FAINT, va="top")
