"""How figures look: colours that the colour-blind can tell apart, and shapes that need none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED

RC: Final[dict[str, Any]] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
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
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "pdf.fonttype": 42,
    "savefig.facecolor": "white",
}
"""Matplotlib's settings for every figure; fonts go into a PDF as TrueType."""
INK: Final = "#222222"
FAINT: Final = "#666666"


@dataclass(frozen=True, slots=True)
class Look:
    """How a variant is drawn: told apart by colour, by marker, and by dash.

    ``dash`` is Matplotlib's: on and off lengths, or ``"-"``; ``order`` says what lies on top.
    """

    label: str
    colour: str
    marker: str
    dash: str | tuple[int, tuple[float, ...]]
    hollow: bool = False
    width: float = 1.8
    order: int = 3


_KNOWN: Final = {
    FILTERED: Look("filtered: with the shadow filter", "#0072B2", "o", "-"),
    UNFILTERED: Look("unfiltered: without it", "#E69F00", "s", (0, (5, 2)), hollow=True),
    BASELINE: Look(
        "blind: never looks at the image", "#8A8A8A", "x", (0, (1, 1.4)), width=1.3, order=2
    ),
}
_MORE: Final = (
    Look("", "#009E73", "^", (0, (7, 2, 1.5, 2))),
    Look("", "#CC79A7", "D", (0, (3, 2)), hollow=True),
    Look("", "#D55E00", "v", (0, (9, 3))),
    Look("", "#56B4E9", "P", (0, (5, 2, 1.5, 2, 1.5, 2)), hollow=True),
    Look("", "#000000", "X", (0, (2, 1))),
)


def looks(variants: Sequence[str]) -> dict[str, Look]:
    """Give each variant its look; one that does not come by default gets the next free one."""
    others = [name for name in variants if name not in _KNOWN]
    found = {
        name: replace(_MORE[index % len(_MORE)], label=name) for index, name in enumerate(others)
    }
    return {name: _KNOWN[name] if name in _KNOWN else found[name] for name in variants}


def heading(figure: Any, title: str, subtitle: str) -> None:
    """Write a figure's title and, smaller, what it shows, at its top left.

    ``figure`` is a Matplotlib Figure; the two lines take the topmost half inch.
    """
    height = figure.get_figheight()
    figure.text(0.012, 1 - 0.10 / height, title, size=11, weight="bold", color=INK, va="top")
    figure.text(0.012, 1 - 0.32 / height, subtitle, size=8.5, color=FAINT, va="top")
