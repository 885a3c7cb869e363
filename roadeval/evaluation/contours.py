"""Boundary F: how well a mask follows the road's edge, whatever the areas beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from roadeval.data import TruthBits
from roadeval.data.arrays import Bits
from roadeval.data.packed import ones
from roadeval.evaluation.bits import disk, grow, square


def boundary_f(masks: Mapping[str, Bits], truth: TruthBits, width: int) -> dict[str, float]:
    """Compute the boundary F of some masks: ``F = 2 P R / (P + R)`` [1]_ [2]_.

    P is the share of the mask's edge pixels that lie within ``width`` of the truth's edge, R the
    share of the truth's edge pixels within ``width`` of the mask's. 0 if only one of the two has
    an edge, NaN if neither has.

    Parameters
    ----------
    masks
        ``(H, words)`` each, by name.
    truth
        Ignored pixels are on neither side of an edge.
    width
        The tolerance in pixels, Euclidean distance.

    References
    ----------
    .. [1] G. Csurka et al., What is a good evaluation measure for semantic segmentation?, BMVC
       2013.
    .. [2] F. Perazzi et al., A Benchmark Dataset and Evaluation Methodology for Video Object
       Segmentation, CVPR 2016, section 5.
    """
    true_edge, labelled = edge_of(truth), truth.labelled
    near_truth = grow(true_edge, disk(width), truth)
    scores = {}
    for name, mask in masks.items():
        edge = edge_of(TruthBits(truth.shape, mask & labelled, labelled & ~mask))
        near = grow(edge, disk(width), truth)
        scores[name] = _f_measure(edge, near_truth, true_edge, near)
    return scores


def edge_of(labels: TruthBits) -> Bits:
    """Mark the road pixels that touch non-road, by side or corner: ``(H, words)``.

    Neither the image's border nor an ignored pixel makes an edge.
    """
    return labels.road & grow(labels.other, square(1), labels)


def _f_measure(edge: Bits, near_truth: Bits, true_edge: Bits, near: Bits) -> float:
    """Compute F of two edges and their neighbourhoods."""
    p, q = ones(edge), ones(true_edge)
    if not p or not q:
        return 0.0 if p or q else math.nan
    precision = ones(edge & near_truth) / p
    recall = ones(true_edge & near) / q
    both = precision + recall
    return 2 * precision * recall / both if both else 0.0
