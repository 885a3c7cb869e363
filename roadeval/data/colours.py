"""The palette: one colour for each meaning, in the recording, the figures and the PDF.

The hues are Okabe and Ito's (https://jfly.uni-koeln.de/color/), which people with any kind
of colour vision can distinguish. Colours are sRGB, ``(r, g, b)`` of 0..255 each.

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
"""The colour of references, which is not one of Okabe and Ito."""
DARK_GREY: Final = (90, 90, 90)

FILTERED: Final = BLUE
UNFILTERED: Final = ORANGE
BLIND: Final = GREY
EXTRA: Final = (GREEN, PURPLE, SKY_BLUE, VERMILLION, YELLOW)
"""Colours of further variants, in a cycle."""

TP: Final = GREEN
FP: Final = VERMILLION
FN: Final = PURPLE
TN: Final = SKY_BLUE
"""The colour of true negatives in graphs; an error map leaves them clear."""

MOST_ERRORS: Final = (26, 10, 0)
NEVER_LABELLED: Final = (187, 187, 187)
"""The darkest shade of a map of errors, and the shade of pixels that no frame labels."""

ROAD: Final = GREEN
IGNORE: Final = (128, 128, 128)
BOUNDARY: Final = YELLOW
SHADOW: Final = SKY_BLUE
RING: Final = YELLOW
"""The colour of the lit road around a shadow, from which the compensation is estimated."""

CLEAR: Final = (0, 0, 0, 0)
"""A fully transparent colour."""


def on_paper(colour: Colour) -> Colour:
    """Return the colour, or a substitute if it is faint on white."""
    return {YELLOW: BLACK, GREY: (138, 138, 138)}.get(colour, colour)


def hex_of(colour: Colour) -> str:
    """Return the colour in the notation of Matplotlib, Typst and HTML: ``#RRGGBB``."""
    return "#{:02X}{:02X}{:02X}".format(*colour)
