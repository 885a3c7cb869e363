"""Exposure and white balance: the ground in front of the vehicle gets the same grey in each frame.

A classifier of colours learns the exposure and the camera along with the road. The reference patch,
which is road in nearly every frame, is a measure of both.

What is brighter than the patch is compressed and not clipped, so that it keeps its differences
where the patch lies in the shade or on a dark vehicle.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Final

import cv2
import numpy as np
from pydantic import Field

from roadeval.data import Layer, LayerKind, LayerSpec, Mask, Rgb
from roadeval.data.arrays import Floats
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.pipeline.stage import Output, Stage, View, per_view, stage_settings

EXPOSED: Final = LayerSpec("exposed", LayerKind.RGB, "Exposure by the reference patch", exact=False)
GAINS: Final = (0.25, 6.0)
"""Lowest and highest gain: a white or a black patch says nothing about the light."""


@stage_settings
class ExposureSettings:
    """Settings of the exposure."""

    level: Annotated[float, Field(gt=0, lt=255)] = 96.0
    """Grey level, 0..255, that the patch's median gets."""
    patch: ReferencePatch = ReferencePatch()
    """The reference patch."""


def gains(image: Rgb, settings: ExposureSettings) -> Floats:
    """Return the gains ``(3,)`` that bring the patch of an ``(H, W, 3)`` image to the level.

    Each channel has its own, so that the road turns grey under any light and camera.
    """
    rows, columns, patch = _box(*image.shape[:2], settings.patch)
    around = image[rows, columns]
    counts = [cv2.calcHist([around], [each], patch, [256], [0, 256]).cumsum() for each in range(3)]
    medians = np.array([float(np.searchsorted(own, own[-1] / 2)) for own in counts])  # the lower
    gain = settings.level / np.maximum(medians, 1.0)
    return np.clip(gain, *GAINS)


@lru_cache(maxsize=16)
def _box(height: int, width: int, patch: ReferencePatch) -> tuple[slice, slice, Mask]:
    """Return rows and columns of the smallest box around the patch, and the patch's mask in it."""
    mask = patch_mask(height, width, patch)
    x, y, columns, rows = cv2.boundingRect(mask)
    here = slice(y, y + rows), slice(x, x + columns)
    return *here, mask[here]


def expose(image: Rgb, gain: Floats, level: float) -> Rgb:
    """Multiply the channels of an ``(H, W, 3)`` uint8 image by ``(3,)`` gains, and compress them.

    A product x up to the level l, a grey level below 255, stays. Above it x becomes
    ``l + r e / (e + r)``, with ``e = x - l`` and the room ``r = 255 - l``: the slope is 1 at the
    level, and 255 is only approached. Then it is rounded.
    """
    product = np.arange(256)[:, None] * gain
    excess, room = np.maximum(product - level, 0), 255 - level
    compressed = np.minimum(product, level) + room * excess / (excess + room)
    table = np.rint(compressed).astype(np.uint8)
    return cv2.LUT(image, table[None])


@per_view
def bind(settings: ExposureSettings, _learnt: None, view: View) -> Output:
    """Expose what is seen."""
    gain = gains(view.image, settings)
    image = expose(view.image, gain, settings.level)
    return Output((Layer(EXPOSED, image),), image=image)


STAGE: Final = Stage(
    name="exposure",
    title="Exposure by the reference patch",
    settings=ExposureSettings,
    bind=bind,
    layers=(EXPOSED,),
    preprocesses=True,
)
