"""Heat maps as pictures of one pixel a cell, from white through a colour to nearly black."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data.colours import Colour

SHADES: Final = 255
"""Steps from zero to the top; the place behind them is of what is not known."""
WHITE: Final = (255, 255, 255)


def palette(colour: Colour, darkest: Colour, unknown: Colour) -> npt.NDArray[np.uint8]:
    """Return ``(256, 3)`` RGB: from white at zero to the darkest, and at last the unknown."""
    ends = np.array([WHITE, colour, darkest], float)
    places = np.linspace(0, 2, SHADES)
    mixed = np.stack([np.interp(places, [0, 1, 2], each) for each in ends.T], axis=1)
    return np.rint([*mixed, unknown]).astype(np.uint8)


def shaded(values: npt.NDArray[np.float64], top: float, colours: npt.NDArray[np.uint8]) -> bytes:
    """Return ``(H, W)`` values as a PNG file of as many pixels; NaN is what is not known."""
    import cv2

    known = np.nan_to_num(np.clip(values / top, 0, 1))
    codes = np.where(np.isnan(values), SHADES, np.rint(known * (SHADES - 1))).astype(int)
    done, content = cv2.imencode(".png", np.ascontiguousarray(colours[codes][..., ::-1]))
    assert done
    return bytes(content)
