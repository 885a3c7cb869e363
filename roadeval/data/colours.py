"""The palette: one colour a meaning, the same in the recording, the figures and the PDF.

The hues are those of Okabe and Ito (https://jfly.uni-koeln.de/color/), which people with any kind
of colour vision can tell apart. Colours are sRGB, ``(r, g, b)`` of 0..255 each.

>>> hex_of(FP)
'#D55E00'
"""

from __future__ import annotations

from typing import Final

Colour = tuple[int, int, int]
ColourWithOpacity = tuple[int, int, int, int]

BLACK: Final = (0, 0, 0)
ORANGE: Final = (230, 159, 0)
SKY_BLUE: Final = (86, 180, 233)
GREEN: Final = (0, 158, 115)
YELLOW: Final = (240, 228, 66)
BLUE: Final = (0, 114, 178)
VERMILLION: Final = (213, 94, 0)
PURPLE: Final = (204, 121, 167)
GREY: Final = (153, 153, 153)
"""Not of Okabe and Ito: for what is there to compare with."""
DARK_GREY: Final = (90, 90, 90)

FILTERED: Final = BLUE
UNFILTERED: Final = ORANGE
BLIND: Final = GREY
EXTRA: Final = (GREEN, PURPLE, SKY_BLUE, VERMILLION, YELLOW)
"""Colours of further variants, in the order in which they are given out, again and again."""

TP: Final = GREEN
FP: Final = VERMILLION
FN: Final = PURPLE
TN: Final = SKY_BLUE
"""The colour of true negatives in graphs; an error map leaves them clear."""

MOST_ERRORS: Final = (26, 10, 0)
NEVER_LABELLED: Final = (187, 187, 187)
"""The darkest shade of a map of errors, and that of what no frame labels."""

ROAD: Final = GREEN
IGNORE: Final = (128, 128, 128)
BOUNDARY: Final = YELLOW
SHADOW: Final = SKY_BLUE
RING: Final = YELLOW
"""The colour of lit road around a shadow, from which its compensation is estimated."""

CLEAR: Final = (0, 0, 0, 0)
"""Fully transparent: what is under it shows."""


_ON_PAPER: Final = {YELLOW: BLACK, GREY: (138, 138, 138)}


def on_paper(colour: Colour) -> Colour:
    """Return the colour, or where it is faint on white another for the same thing."""
    return _ON_PAPER.get(colour, colour)


def hex_of(colour: Colour) -> str:
    """Return the colour as Matplotlib, Typst and HTML write it: ``#RRGGBB``."""
    return "#{:02X}{:02X}{:02X}".format(*colour)
