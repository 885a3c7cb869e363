"""Phase 2, the shadow filter (section 3.2): finds shadow and gives it the colours around it.

The mask (Eq. 6-8) is in `shadow_mask`, components, rings and the compensation (Eq. 9-11) in
`compensation`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from roadeval.data import (
    LabelClass,
    Layer,
    LayerKind,
    LayerSpec,
    Packed,
    Truth,
    colours,
    everywhere,
)
from roadeval.kernels import KERNELS
from roadeval.pipeline.paper.compensation import Compensation, lift
from roadeval.pipeline.paper.shadow_mask import (
    NDI_CODES,
    otsu_threshold,
    printed_threshold,
    shadow_mask,
)
from roadeval.pipeline.paper.shadow_settings import ShadowSettings
from roadeval.pipeline.stage import Output, Stage, View

SHADOW_COLOUR: Final = colours.with_opacity(colours.SHADOW, 160)
RING_COLOUR: Final = colours.with_opacity(colours.RING, 220)

NDI: Final = LayerSpec("ndi", LayerKind.SCALAR, "NDI (Eq. 6)", value_range=(-1.0, 1.0))
SHADOW: Final = LayerSpec(
    "shadow",
    LayerKind.MASK,
    "Shadow mask (Eq. 8)",
    (LabelClass(0, "lit", colours.CLEAR), LabelClass(1, "shadow", SHADOW_COLOUR)),
)
RINGS: Final = LayerSpec(
    "rings",
    LayerKind.MASK,
    "Components and buffer rings (Eq. 9-10)",
    (
        LabelClass(0, "none", colours.CLEAR),
        LabelClass(1, "shadow", SHADOW_COLOUR),
        LabelClass(2, "ring", RING_COLOUR),
    ),
)
COMPENSATED: Final = LayerSpec(
    "compensated", LayerKind.RGB, "Compensated image (Eq. 11)", exact=False
)


def bind(settings: ShadowSettings, _parameters: None) -> Callable[[View], Output]:
    """Return the filter as a pure function of what it sees."""
    threshold_of = otsu_threshold if settings.threshold == "otsu" else printed_threshold

    def run(view: View) -> Output:
        codes, histogram = KERNELS.look_up_sum_min(view.planes, NDI_CODES)
        threshold = threshold_of(histogram)
        mask = shadow_mask(codes, threshold, inclusive=settings.inclusive)
        shadow = Packed.of(mask)
        image, ring, count, change = lift(view, shadow, settings)
        lit = everywhere(shadow.shape) & ~(shadow.bits | ring.bits)
        return Output(
            layers=(
                Layer(NDI, codes),
                Layer(SHADOW, shadow),
                Layer(RINGS, mask + 2 * ring.pixels()),
                Layer(COMPENSATED, image),
            ),
            image=image,
            regions={"shadow": shadow, "shadow_edge": ring, "lit": Packed(lit, shadow.width)},
            facts=_facts(threshold, shadow, count, change),
        )

    return run


def oracle(settings: ShadowSettings, _parameters: None) -> Callable[[View, Truth], Output]:
    """Return the filter as it would be if it knew what is shadow; its compensation stays."""

    def run(view: View, truth: Truth) -> Output:
        return Output(image=lift(view, Packed.of(truth == 1), settings)[0])

    return run


def _facts(
    threshold: int | None, shadow: Packed, count: int, change: Compensation
) -> dict[str, float]:
    greatest = change.gain.max(axis=1)[change.applied]
    return {
        "threshold": float("nan") if threshold is None else threshold / 127.5 - 1.0,
        "shadow_share": shadow.area() / math.prod(shadow.shape),
        "components": float(count),
        "compensated": float(greatest.size),
        "max_gain": float(greatest.max()) if greatest.size else 1.0,
        "gains_above_3": float(np.count_nonzero(greatest > 3.0)),
    }


def layers(_settings: ShadowSettings) -> tuple[LayerSpec, ...]:
    """Return the layers of the filter, in the order of the equations."""
    return NDI, SHADOW, RINGS, COMPENSATED


STAGE: Final[Stage[ShadowSettings, None]] = Stage(
    name="shadow",
    title="Phase 2: shadow filter",
    settings=ShadowSettings,
    bind=bind,
    layers=layers,
    is_filter=True,
    oracle=oracle,
)
