"""Layers as pictures for a page: whatever a stage hands out, painted by its description."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import LayerKind, LayerSpec, Rgb
from roadeval.report.blocks import Asset

WIDTH: Final = 420
"""Pixels across a picture, at most: about 200 an inch at a quarter of the page."""
QUALITY: Final = 85
DARKEN: Final = 0.75
"""How much of the camera's brightness stays below an overlay."""


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """One layer on one frame.

    Parameters
    ----------
    title
        A few words.
    image
        ``(H, W, 3)`` uint8 RGB: the camera's image.
    spec, array
        The layer, as in `roadeval.data.Layer`; None for the camera's image alone. A scalar map
        is in its own unit.
    """

    title: str
    image: Rgb
    spec: LayerSpec | None = None
    array: npt.NDArray[Any] | None = None


def asset(shot: Shot, width: int = WIDTH) -> Asset:
    """Paint a layer and encode the picture, at most ``width`` pixels across."""
    import cv2

    small = shrunk(paint(shot), width)
    options = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
    done, jpeg = cv2.imencode(".jpg", cv2.cvtColor(small, cv2.COLOR_RGB2BGR), options)
    assert done
    return Asset(jpeg.tobytes())


def paint(shot: Shot) -> Rgb:
    """Turn a layer into ``(H, W, 3)`` uint8 RGB."""
    if shot.spec is None or shot.array is None:
        return shot.image
    match shot.spec.kind:
        case LayerKind.RGB:
            return shot.array.astype(np.uint8, copy=False)
        case LayerKind.SCALAR:
            return _coloured(shot.spec, shot.array)
        case LayerKind.MASK | LayerKind.LABELS:
            return _overlaid(shot.image, shot.spec, shot.array)


def _coloured(spec: LayerSpec, values: npt.NDArray[Any]) -> Rgb:
    """Colour a map of numbers over its range with Viridis, as the recording's viewer does."""
    import cv2

    low, high = spec.value_range
    codes = np.clip((values - low) * (255 / (high - low)), 0, 255).astype(np.uint8)
    bgr = cv2.applyColorMap(codes, cv2.COLORMAP_VIRIDIS)
    rgb: Rgb = cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)
    return rgb


def _overlaid(image: Rgb, spec: LayerSpec, labels: npt.NDArray[Any]) -> Rgb:
    """Lay the classes' colours over the darkened image."""
    table = np.zeros((256, 4), np.float32)
    for label in spec.classes:
        table[label.value] = label.rgba
    colours = table[labels]
    opacity = colours[..., 3:] / 255
    mixed = image * DARKEN * (1 - opacity) + colours[..., :3] * opacity
    painted: Rgb = np.rint(mixed).astype(np.uint8)
    return painted


def shrunk(image: Rgb, width: int) -> Rgb:
    """Bring an image down to ``width`` pixels across, if it is wider."""
    import cv2

    height, wide = image.shape[:2]
    if wide <= width:
        return image
    size = (width, max(round(height * width / wide), 1))
    small: Rgb = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return small
