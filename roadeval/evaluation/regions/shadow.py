"""The regions that stages hand out: what the shadow filter took for shadow, its edge, and light."""

from __future__ import annotations

from typing import Final

from roadeval.data.arrays import Bits
from roadeval.data.packed import Packed
from roadeval.evaluation.region import LabelledFrame, RegionFamily, fixed

TITLES: Final = {
    "shadow": "inside detected shadow",
    "shadow_edge": "at the edge of detected shadow",
    "lit": "in light",
}


def detected(labelled: LabelledFrame) -> dict[str, Bits]:
    """Collect the regions that stages handed out.

    The first variant that has a region of a name gives it to all: variants are compared on the
    same pixels.
    """
    masks: dict[str, Packed] = {}
    for variant in labelled.variants:
        for result in variant.stages:
            for name, mask in result.output.regions.items():
                masks.setdefault(name, mask)
    return dict(zip(masks, labelled.truth.bits_of(masks.values()), strict=True))


REGION = RegionFamily(order=10, found=detected, titles=fixed(TITLES))
