"""A shadow filter with a learnt gate: dark road becomes as bright as the lit road of its frame.

The paper's filter (`shadow`) takes whatever has a high NDI for shadow. This one asks of every dark
pixel how likely it is road in the shade (`shaded_road`), and brightens it so far. There is no
region and no hard threshold in it: half a doubt is half the gain. Where the training frames have no
road in the shade nothing is learnt, and every frame passes as it came, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import cv2
import numpy as np

from roadeval.data import LabelClass, Layer, LayerKind, LayerSpec, Mask, Rgb, Truth, colours
from roadeval.data.arrays import Values
from roadeval.data.packed import Packed
from roadeval.pipeline.beyond.shade_candidates import OFFSET, GatedSettings, Look, as_told, look
from roadeval.pipeline.beyond.shaded_road import ShadedRoad, fit, gains, shade_of
from roadeval.pipeline.beyond.working_image import enlarged, reduced, stretched
from roadeval.pipeline.paper.shadow import SHADOW_COLOUR
from roadeval.pipeline.stage import Output, Stage, View

EDGE: Final = 2
"""Pixels of the working image beside the shadow that are neither it nor lit."""


def _mask(name: str, title: str, inside: str) -> LayerSpec:
    classes = (LabelClass(0, "none", colours.CLEAR), LabelClass(1, inside, SHADOW_COLOUR))
    return LayerSpec(name, LayerKind.MASK, title, classes)


CANDIDATES: Final = _mask("candidates", "Dark, where road may be", "candidate")
SHADED: Final = LayerSpec(
    "shaded",
    LayerKind.SCALAR,
    "How likely it is road in the shade",
    value_range=(0.0, 1.0),
    exact=False,
)
SHADOW: Final = _mask("shadow", "More likely road in the shade than not", "shadow")
COMPENSATED: Final = LayerSpec("compensated", LayerKind.RGB, "Compensated image", exact=False)


def bind(settings: GatedSettings, model: ShadedRoad) -> Callable[[View], Output]:
    """Return the filter as a pure function of what it sees."""

    def run(view: View) -> Output:
        seen = look(reduced(view.image, settings.width), model.place, settings)
        shaded = shade_of(seen, model, settings)
        gain = gains(seen, shaded, settings)
        image = brighten(view.image, gain) if (shaded > 0).any() else view.image
        masks = {name: enlarged(m, view.image.shape) for name, m in _masks(seen, shaded).items()}
        greatest = np.maximum.reduce(cv2.split(gain))
        arrays: dict[str, Mask | Values] = {
            **masks,
            "shaded": stretched(shaded, view.image.shape),
            "gain": stretched(greatest, view.image.shape),
            "compensated": image,
        }
        return Output(
            layers=tuple(Layer(spec, arrays[spec.name]) for spec in layers(settings)),
            image=image,
            regions={name: Packed.of(masks[name]) for name in ("shadow", "shadow_edge", "lit")},
            facts={
                "shadow_share": float(masks["shadow"].mean()),
                "max_gain": float(greatest.max()),
                "sunlit_level": seen.level / 3,
            },
        )

    return run


def oracle(settings: GatedSettings, model: ShadedRoad) -> Callable[[View, Truth], Output]:
    """Return the filter as it would be if it knew what is shadow."""

    def run(view: View, truth: Truth) -> Output:
        small = reduced(view.image, settings.width)
        shadow = enlarged((truth == 1).view(np.uint8), small.shape)
        if not shadow.any():
            return Output(image=view.image)
        seen = as_told(look(small, model.place, settings), shadow)
        return Output(image=brighten(view.image, gains(seen, shadow.astype(np.float32), settings)))

    return run


def brighten(image: Rgb, gain: Values) -> Rgb:
    """Return ``(I + 8) g - 8`` of ``(H, W, 3)`` uint8 RGB; rounded and clipped.

    Gains ``(h, w, 3)`` float32, none below 1, are of colours with `OFFSET` added: noise in the dark
    does not grow by all of them.
    """
    bright = image.copy()
    touched = np.flatnonzero((gain > 1).any(axis=(1, 2)))
    if len(touched):
        scale = len(image) / len(gain)
        # Interpolation reaches no further than to the next row.
        first, end = int((touched[0] - 1) * scale), math.ceil((touched[-1] + 2) * scale)
        rows = slice(max(first, 0), end)
        here = stretched(gain, image.shape)[rows]
        result = cv2.multiply(image[rows], here, dtype=cv2.CV_32F)
        cv2.scaleAdd(here, float(OFFSET), result, dst=result)
        cv2.convertScaleAbs(result, dst=bright[rows], beta=-float(OFFSET))
    return bright


def _masks(seen: Look, shaded: Values) -> dict[str, Mask]:
    """Return masks and regions at the size of the working image, by name."""
    shadow = (shaded > 0.5).view(np.uint8)
    edge = cv2.dilate(shadow, np.ones((2 * EDGE + 1, 2 * EDGE + 1), np.uint8)) - shadow
    return {
        "candidates": seen.candidates.view(np.uint8),
        "shadow": shadow,
        "shadow_edge": edge,
        "lit": 1 - (shadow | edge),
    }


def layers(settings: GatedSettings) -> tuple[LayerSpec, ...]:
    """Return the layers of the filter, in the order of its steps."""
    gain = LayerSpec(
        "gain",
        LayerKind.SCALAR,
        "Greatest gain of a channel",
        value_range=(1.0, settings.greatest),
        exact=False,
    )
    return CANDIDATES, SHADED, SHADOW, gain, COMPENSATED


STAGE: Final = Stage(
    name="gated",
    title="Phase 2: gated shadow filter",
    settings=GatedSettings,
    bind=bind,
    layers=layers,
    fit=fit,
    parameters=ShadedRoad,
    is_filter=True,
    oracle=oracle,
)
