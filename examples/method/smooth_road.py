"""Road by smoothness: what has little more texture than the ground in front of the vehicle."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from roadeval.data import Layer, LayerKind, LayerSpec, Output, Packed, mask_spec
from roadeval.pipeline.stage import Stage, View

TEXTURE = LayerSpec("texture", LayerKind.SCALAR, "Texture", value_range=(0, 40), exact=False)
SMOOTH = mask_spec("smooth", "As smooth as the ground ahead")


@dataclass(frozen=True)
class SmoothSettings:
    """Settings of road by smoothness.

    window: Side of the square in which texture is measured, in pixels.
    factor: Texture of road at most, as a multiple of the patch's median.
    """

    window: int = 7
    factor: float = 2.0


def bind(settings: SmoothSettings, _parameters: None) -> Callable[[View], Output]:
    """Return the stage as a pure function of what it sees."""

    def run(view: View) -> Output:
        grey = view.image.mean(axis=2, dtype=np.float32)
        mean, power = (cv2.blur(each, (settings.window,) * 2) for each in (grey, grey * grey))
        texture = np.sqrt(np.maximum(power - mean * mean, 0))
        height, width = grey.shape
        ahead = texture[height * 3 // 4 : height * 19 // 20, width * 2 // 5 : width * 3 // 5]
        road = Packed.of(texture <= settings.factor * np.median(ahead))
        return Output((Layer(TEXTURE, texture), Layer(SMOOTH, road)), mask=road)

    return run


STAGE = Stage("smooth", "Road by smoothness", SmoothSettings, bind, lambda _: (TEXTURE, SMOOTH))
