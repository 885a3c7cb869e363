"""The regions that every run counts: detected and true shadow, the road's edge, image rows."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import Final

import numpy as np

from roadeval.data import Packed, TruthBits, everywhere
from roadeval.data.arrays import Bits
from roadeval.evaluation.metres import ABOVE, UNPLACED
from roadeval.evaluation.region import LabelledFrame, Region, grow, square

SHADOW_TITLES: Final = {
    "shadow": "inside detected shadow",
    "shadow_edge": "at the edge of detected shadow",
    "lit": "in light",
}


def detected_regions(labelled: LabelledFrame) -> dict[str, Bits]:
    """Return the regions that stages computed, ``(H, words)`` each, by name.

    The first variant that has a region sets it for all, so all are compared on the same pixels.
    """
    masks: dict[str, Packed] = {}
    for variant in labelled.variants:
        for result in variant.stages:
            for name, mask in result.output.regions.items():
                masks.setdefault(name, mask)
    return dict(zip(masks, labelled.truth.bits_of(masks.values()), strict=True))


def true_shadow(labelled: LabelledFrame) -> dict[str, Bits]:
    """Return the pixels in shadow, by the truth of shadow; empty if there is none."""
    shadow = labelled.frame.shadow_truth
    if shadow is None:
        return {}
    return {"true_shadow": labelled.truth.bits_of([Packed.of(shadow == 1)])[0]}


def boundary(truth: TruthBits, width: int) -> Bits:
    """Mark the pixels within ``width`` of the edge between road and non-road, ``(H, words)``.

    A pixel is marked if the square of side ``2 * width + 1`` around it holds both road and non-road
    of the truth. An ignored pixel is neither, so road and ignored pixels have no edge between them.
    """
    element = square(width)
    return grow(truth.road, element, truth) & grow(truth.other, element, truth)


def boundary_and_interior(labelled: LabelledFrame) -> dict[str, Bits]:
    """Return the pixels near the truth's edge, and all others, ``(H, words)`` each."""
    near = boundary(labelled.truth, labelled.settings.boundary_width)
    return {"boundary": near, "interior": near ^ everywhere(labelled.truth.shape)}


@lru_cache(maxsize=8)
def row_bands(shape: tuple[int, int], bands: int) -> Mapping[str, Bits]:
    """Divide an image's rows into stripes of equal height to within a row, ``(H, words)`` each.

    ``shape`` is height and width in pixels; ``band_0`` is the topmost stripe.
    """
    stripe = np.arange(shape[0]) * bands // shape[0]
    image = everywhere(shape)
    return {
        f"band_{index}": np.where((stripe == index)[:, None], image, np.uint64(0))
        for index in range(bands)
    }


def titles_of_bands(names: Collection[str], height: int) -> dict[str, str]:
    """Return the titles of the bands: their rows, or their numbers if ``height`` is 0."""
    bands = [name for name in names if name.startswith("band_")]
    titles = {}
    for place, name in enumerate(bands):
        first, after = (-(-height * edge // len(bands)) for edge in (place, place + 1))
        part = f"image rows, part {place + 1} of {len(bands)}"
        rows = f"image rows {first}\N{EN DASH}{after - 1}" if height else part
        titles[name] = rows + {0: ", the top", len(bands) - 1: ", the bottom"}.get(place, "")
    return titles


def titles_of_distances(names: Collection[str], _height: int) -> dict[str, str]:
    """Return the titles of the regions by distance."""
    bands = [match for name in names if (match := _DISTANCE.fullmatch(name))]
    titles = {match[0]: f"{match[1]} to {match[2]} m ahead" for match in bands}
    if UNPLACED in names:
        titles[UNPLACED] = "farther away, or above the horizon"
    return titles


_DISTANCE: Final = re.compile(r"(\d+)-(\d+)m")
REGIONS: Final = (
    Region(SHADOW_TITLES, order=10, find=detected_regions),
    Region({"true_shadow": "inside true shadow"}, order=20, find=true_shadow),
    Region(
        {"boundary": "near the road's edge", "interior": "away from the road's edge"},
        order=30,
        find=boundary_and_interior,
    ),
    Region(
        titles_of_bands,
        order=40,
        find=lambda frame: row_bands(frame.truth.shape, frame.settings.bands),
    ),
    Region(
        titles_of_distances,
        order=50,
        find=lambda frame: frame.survey.regions if frame.survey else {},
    ),
    Region({ABOVE: "the ground seen from above"}, order=51, find=lambda _: {}),
)
