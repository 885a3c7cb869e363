"""A stated width around the truth's edge, where annotators differ, and the interior beyond it."""

from __future__ import annotations

from typing import Final

from roadeval.data import TruthBits
from roadeval.data.arrays import Bits
from roadeval.data.packed import everywhere
from roadeval.evaluation.bits import grow, square
from roadeval.evaluation.region import LabelledFrame, RegionFamily, fixed

TITLES: Final = {"boundary": "near the road's edge", "interior": "away from the road's edge"}


def boundary(truth: TruthBits, width: int) -> Bits:
    """Mark the pixels within ``width`` of the edge between road and non-road, ``(H, words)``.

    A pixel belongs to it if the square of side ``2 * width + 1`` around it holds both road and
    non-road of the truth. An ignored pixel is neither, so where road meets ignored pixels there
    is no edge. ``width`` is in pixels on either side, in chessboard distance.
    """
    element = square(width)
    return grow(truth.road, element, truth) & grow(truth.other, element, truth)


def _halves(labelled: LabelledFrame) -> dict[str, Bits]:
    near = boundary(labelled.truth, labelled.settings.boundary_width)
    return {"boundary": near, "interior": near ^ everywhere(labelled.truth.shape)}


REGION = RegionFamily(order=30, found=_halves, titles=fixed(TITLES), whole=True)
