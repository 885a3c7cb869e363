"""A shadow filter with gates: section 3.2's candidates, components and rings, each questioned.

The paper's filter (`shadow`) takes whatever has a high NDI for shadow. This one keeps its four
steps and asks at each whether what it sees can be a shadow on the road:

1. candidates are dark pixels whose colour is the road's under skylight (`road_light`);
2. components are kept if they are as smooth as road, near enough to be judged, and neither too
   dark nor too bright for shade;
3. rings begin beyond the penumbra and hold lit road alone;
4. compensation multiplies each channel by what the ring has more of it, with soft edges.

Where no component is kept the image passes as it came, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import LabelClass, Layer, LayerKind, LayerSpec, Mask, Rgb, Truth, colours
from roadeval.data.packed import Packed
from roadeval.pipeline.beyond import road_light
from roadeval.pipeline.beyond.road_light import Map, RoadLight
from roadeval.pipeline.beyond.shadow_gates import (
    ACCEPTED,
    VERDICTS,
    GatedImage,
    GatedSettings,
    MeasuredComponents,
    components,
    eroded,
    judge,
    look,
)
from roadeval.pipeline.beyond.working_image import enlarged, reduced, stretched
from roadeval.pipeline.paper.shadow import RING_COLOUR, SHADOW_COLOUR
from roadeval.pipeline.stage import Output, Stage, TrainingSet, View

Verdicts = npt.NDArray[np.uint8]


def _mask(name: str, title: str, inside: str) -> LayerSpec:
    classes = (LabelClass(0, "none", colours.CLEAR), LabelClass(1, inside, SHADOW_COLOUR))
    return LayerSpec(name, LayerKind.MASK, title, classes)


CANDIDATES: Final = _mask("candidates", "Dark, and of the road's colour", "candidate")
COMPONENTS: Final = LayerSpec(
    "components", LayerKind.LABELS, "Components, and why they were rejected", VERDICTS
)
SHADOW: Final = _mask("shadow", "Accepted shadow", "shadow")
RINGS: Final = LayerSpec(
    "rings",
    LayerKind.MASK,
    "Accepted shadow, and lit road around components",
    (*SHADOW.classes, LabelClass(2, "ring", RING_COLOUR)),
)
COMPENSATED: Final = LayerSpec("compensated", LayerKind.RGB, "Compensated image", exact=False)


# --- Compensation ---------------------------------------------------------------------------------


def gain_map(found: MeasuredComponents, verdicts: Verdicts, settings: GatedSettings) -> Map:
    """Return the gain of each channel at each pixel, ``(h, w, 3)`` float32; 1 is no change.

    In an accepted component it is ring over core, no less than 1 and no more than one over the
    least ratio; then averaged over a square, so that it rises softly at the edge. The outermost
    pixel has some sun already: all of the gain there would leave a bright seam.
    """
    gains = np.clip(1 / found.ratio, 1.0, 1 / settings.ratio[0])
    gains[verdicts != ACCEPTED] = 1.0
    labels = np.where(eroded((found.labels > 0).view(np.uint8), 1), found.labels, 0)
    side = (settings.softness, settings.softness)
    soft: Map = cv2.blur(gains.astype(np.float32)[labels], side)
    return soft


def brighten(image: Rgb, gain: Map) -> Rgb:
    """Multiply ``(H, W, 3)`` uint8 RGB by gains ``(h, w, 3)`` float32; rounded and clipped."""
    bright: Rgb = cv2.multiply(image, stretched(gain, image.shape), dtype=cv2.CV_8U)
    return bright


# --- The stage ------------------------------------------------------------------------------------


def bind(settings: GatedSettings, road: RoadLight) -> Callable[[View], Output]:
    """Return the filter as a pure function of what it sees."""

    def run(view: View) -> Output:
        scene = look(reduced(view.image, settings.width), road, settings)
        found = components(scene, settings)
        verdicts = judge(found, settings)
        gain = gain_map(found, verdicts, settings)
        accepted = bool((verdicts == ACCEPTED).any())
        image = brighten(view.image, gain) if accepted else view.image
        maps = _maps(scene, found, verdicts, settings)
        large = {name: enlarged(mask, view.image.shape) for name, mask in maps.items()}
        greatest = stretched(np.maximum.reduce(cv2.split(gain)), view.image.shape)
        arrays: dict[str, Mask | Map] = {**large, "gain": greatest, "compensated": image}
        return Output(
            layers=tuple(Layer(spec, arrays[spec.name]) for spec in layers(settings)),
            image=image,
            regions={name: Packed.of(large[name]) for name in ("shadow", "shadow_edge", "lit")},
            facts=_facts(large["shadow"], verdicts, greatest),
        )

    return run


def oracle(settings: GatedSettings, road: RoadLight) -> Callable[[View, Truth], Output]:
    """Return the filter as it would be if it knew what is shadow.

    True shadow takes the place of candidates and gates. Rings of lit road, gains and soft edges
    stay; a component without a ring, or too thin for a core to measure, stays as it is.
    """

    def run(view: View, truth: Truth) -> Output:
        small = reduced(view.image, settings.width)
        shadow = enlarged((truth == 1).view(np.uint8), small.shape)
        found = components(replace(look(small, road, settings), candidates=shadow), settings)
        gain = gain_map(found, np.full(len(found.area), ACCEPTED, np.uint8), settings)
        return Output(image=brighten(view.image, gain) if (gain > 1).any() else view.image)

    return run


def _maps(
    scene: GatedImage, found: MeasuredComponents, verdicts: Verdicts, settings: GatedSettings
) -> dict[str, Mask]:
    """Return masks, label images and regions at the size of the working image, by name."""
    kinds = verdicts[found.labels]
    shadow = (kinds == ACCEPTED).view(np.uint8)
    side = 2 * settings.gap + 1
    edge = cv2.dilate(shadow, np.ones((side, side), np.uint8)) - shadow
    return {
        "candidates": scene.candidates,
        "components": kinds,
        "shadow": shadow,
        "rings": np.where(found.rings > 0, np.uint8(2), shadow),
        "shadow_edge": edge,
        "lit": 1 - (shadow | edge),
    }


def _facts(shadow: Mask, verdicts: Verdicts, gain: Map) -> dict[str, float]:
    counts = np.bincount(verdicts[1:], minlength=len(VERDICTS))
    rejected = {kind.name.replace(" ", "_"): float(counts[kind.value]) for kind in VERDICTS[2:]}
    return {
        "shadow_share": float(shadow.mean()),
        "components": float(len(verdicts) - 1),
        "compensated": float(counts[ACCEPTED]),
        "max_gain": float(gain.max()),
        **rejected,
    }


def layers(settings: GatedSettings) -> tuple[LayerSpec, ...]:
    """Return the layers of the filter, in the order of its steps."""
    span = (1.0, 1 / settings.ratio[0])
    gain = LayerSpec(
        "gain", LayerKind.SCALAR, "Greatest gain of a channel", value_range=span, exact=False
    )
    return CANDIDATES, COMPONENTS, SHADOW, RINGS, gain, COMPENSATED


def fit(sample: TrainingSet, _settings: GatedSettings) -> RoadLight:
    """Learn the road's colours in the sun and in the shade."""
    return road_light.fit(sample)


STAGE: Final = Stage(
    name="gated",
    title="Phase 2: gated shadow filter",
    settings=GatedSettings,
    bind=bind,
    layers=layers,
    fit=fit,
    parameters=RoadLight,
    is_filter=True,
    oracle=oracle,
)
