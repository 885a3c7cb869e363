"""How well a mask follows the road's edge, however large the areas on either side of it are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from roadeval.data import IGNORE, NON_ROAD, ROAD, Mask, Truth


def boundary_f(masks: Mapping[str, Mask], truth: Truth, width: int) -> dict[str, float]:
    """Compute the boundary F of some masks: ``F = 2 P R / (P + R)`` [1]_ [2]_.

    P is the share of the mask's edge pixels that lie within ``width`` of the truth's edge, R the
    share of the truth's edge pixels within ``width`` of the mask's. 0 if only one of the two has
    an edge, NaN if neither has.

    Parameters
    ----------
    masks
        By name, each ``(H, W)`` uint8 (0, 1).
    truth
        ``(H, W)`` uint8 (0, 1, 255). Ignored pixels are on neither side of an edge.
    width
        The tolerance in pixels, Euclidean distance.

    References
    ----------
    .. [1] G. Csurka et al., What is a good evaluation measure for semantic segmentation?, BMVC
       2013.
    .. [2] F. Perazzi et al., A Benchmark Dataset and Evaluation Methodology for Video Object
       Segmentation, CVPR 2016, section 5.
    """
    import cv2

    def near(edge: Mask) -> Mask:
        found: Mask = cv2.dilate(edge, disk(width))
        return found

    ignored = (truth == IGNORE).view(np.uint8) * np.uint8(IGNORE)
    true_edge = edge_of(truth)
    near_truth = near(true_edge)
    scores = {}
    for name, mask in masks.items():
        edge = edge_of(mask | ignored)
        scores[name] = _f_measure(edge, near_truth, true_edge, near(edge))
    return scores


def edge_of(labels: Truth) -> Mask:
    """Mark the road pixels that touch non-road, by side or corner: ``(H, W)`` uint8.

    Neither the image's border nor an ignored pixel makes an edge.
    """
    import cv2

    other = cv2.dilate((labels == NON_ROAD).view(np.uint8), np.ones((3, 3), np.uint8))
    edge: Mask = (labels == ROAD).view(np.uint8) & other
    return edge


@lru_cache(maxsize=8)
def disk(radius: int) -> Mask:
    """Give the offsets within ``radius``, ``(2 * radius + 1,) * 2`` uint8."""
    rows, columns = np.ogrid[-radius : radius + 1, -radius : radius + 1]
    inside: Mask = (rows**2 + columns**2 <= radius**2).astype(np.uint8)
    return inside


def _f_measure(edge: Mask, near_truth: Mask, true_edge: Mask, near: Mask) -> float:
    """Give F of two edges and their neighbourhoods."""
    import cv2

    p, q = cv2.countNonZero(edge), cv2.countNonZero(true_edge)
    if not p or not q:
        return 0.0 if p or q else math.nan
    precision = cv2.countNonZero(edge & near_truth) / p
    recall = cv2.countNonZero(true_edge & near) / q
    both = precision + recall
    return 2 * precision * recall / both if both else 0.0
