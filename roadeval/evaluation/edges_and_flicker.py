"""Boundary F and flicker of a drive's final masks, averaged over its frames."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping
from typing import Any, Final

from roadeval.data import FrameResult, Packed, Role, TruthBits, ones
from roadeval.data.arrays import Bits
from roadeval.evaluation.counts import disk, grow, square


class Flicker:
    """How much of a drive's masks changes from one frame to the next.

    ``flicker = sum |m_t != m_(t-1)| / sum |L_t|`` over all pairs of consecutive frames, where
    ``L_t`` are the pixels that both truths label. The truth's own, counted alike, stands beside
    it: moving things must change, and only what exceeds that is flicker. Motion is not taken
    out, as it is in [1]_ by optical flow.

    References
    ----------
    .. [1] S. Varghese et al., Unsupervised Temporal Consistency Metric for Video Segmentation in
       Highly-Automated Driving, CVPR Workshops 2020.
    """

    def __init__(self) -> None:
        self._before: tuple[TruthBits, Mapping[str, Packed]] | None = None
        self._pairs: Final[Counter[str]] = Counter()
        self._labelled: Final[Counter[str]] = Counter()
        self._changed: Final[Counter[str]] = Counter()
        self._true: Final[Counter[str]] = Counter()

    def add(self, now: TruthBits, masks: Mapping[str, Packed]) -> None:
        """Add the next frame: its truth and the final masks."""
        before, self._before = self._before, (now, masks)
        if before is None or before[0].shape != now.shape:
            return
        labelled = now.labelled & before[0].labelled
        count, moved = ones(labelled), ones((now.road ^ before[0].road) & labelled)
        for name in masks.keys() & before[1].keys():
            self._pairs[name] += 1
            self._labelled[name] += count
            self._true[name] += moved
            self._changed[name] += ones((masks[name].bits ^ before[1][name].bits) & labelled)

    def interrupt(self) -> None:
        """Note that the next frame does not follow the one before."""
        self._before = None

    def totals(self, name: str) -> dict[str, Any]:
        """Return ``flicker`` and ``truth_flicker``, None without a pair, and the ``pairs``."""
        labelled = self._labelled[name]
        return {
            "flicker": self._changed[name] / labelled if labelled else None,
            "truth_flicker": self._true[name] / labelled if labelled else None,
            "pairs": self._pairs[name],
        }


class EdgesAndFlicker:
    """Sums up boundary F and flicker of every final mask.

    Parameters
    ----------
    width
        The tolerance of boundary F in pixels.
    """

    def __init__(self, width: int) -> None:
        self._width: Final = width
        self._contours: Final[defaultdict[str, list[float]]] = defaultdict(lambda: [0.0, 0])
        self._flicker: Final = Flicker()

    def add(self, result: FrameResult) -> None:
        """Add a frame, in the drive's order. One that is not evaluated interrupts the flicker."""
        if result.role is not Role.EVALUATED or result.truth_bits is None:
            self._flicker.interrupt()
            return
        for name, score in result.contours.items():
            total = self._contours[name]
            if not math.isnan(score):
                total[0] += score
                total[1] += 1
        finals = {v.variant: mask for v in result.variants for _, mask in v.masks()}
        self._flicker.add(result.truth_bits, finals)

    def interrupt(self) -> None:
        """Note that a frame was lost here."""
        self._flicker.interrupt()

    def totals(self) -> dict[str, dict[str, Any]]:
        """Return by variant: mean ``boundary_F`` over ``frames`` that have it, and the flicker.

        The baseline, whose mask is always the same, has no flicker.

        See `roadeval.evaluation.edges_and_flicker.boundary_f` and `Flicker`.
        """
        return {
            name: {
                "boundary_F": total / count if count else None,
                "frames": count,
                "width": self._width,
                **self._flicker.totals(name),
            }
            for name, (total, count) in self._contours.items()
        }


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
