"""Boundary F and flicker of a drive's final masks, averaged over its frames."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from roadeval.data import FrameResult, Packed, Role, TruthBits, ones
from roadeval.data.arrays import Bits
from roadeval.evaluation.region import disk, grow, square


@dataclass(slots=True)
class _Sums:
    """Of one variant."""

    score: float = 0.0
    frames: int = 0
    """Boundary F, and the frames that have it."""
    pairs: int = 0
    labelled: int = 0
    changed: int = 0
    moved: int = 0
    """Pairs of frames; the pixels that both label; where the mask, and where the truth changes."""


class EdgesAndFlicker:
    """Sums up boundary F and flicker of every final mask.

    ``flicker = sum |m_t != m_(t-1)| / sum |L_t|`` over all pairs of consecutive frames, where
    ``L_t`` are the pixels that both truths label. ``truth_flicker`` is the truth's own: moving
    things must change, and only what exceeds that is flicker. Motion is not removed by optical
    flow, as it is in [1]_. ``width`` is the tolerance of boundary F in pixels.

    References
    ----------
    .. [1] S. Varghese et al., Unsupervised Temporal Consistency Metric for Video Segmentation in
       Highly-Automated Driving, CVPR Workshops 2020.
    """

    def __init__(self, width: int) -> None:
        self._width: Final = width
        self._sums: Final[defaultdict[str, _Sums]] = defaultdict(_Sums)
        self._before: tuple[TruthBits, Mapping[str, Packed]] | None = None

    def add(self, result: FrameResult) -> None:
        """Add a frame, in the drive's order. One that is not evaluated interrupts the flicker."""
        now = result.truth_bits
        if result.role is not Role.EVALUATED or now is None:
            self.interrupt()
            return
        for name, score in result.contours.items():
            own = self._sums[name]
            if not math.isnan(score):
                own.score += score
                own.frames += 1
        masks = {v.variant: mask for v in result.variants for _, mask in v.masks()}
        before, self._before = self._before, (now, masks)
        if before is None or before[0].shape != now.shape:
            return
        labelled = now.labelled & before[0].labelled
        count, moved = ones(labelled), ones((now.road ^ before[0].road) & labelled)
        for name in masks.keys() & before[1].keys():
            own = self._sums[name]
            own.pairs += 1
            own.labelled += count
            own.moved += moved
            own.changed += ones((masks[name].bits ^ before[1][name].bits) & labelled)

    def interrupt(self) -> None:
        """Note that the next frame does not follow the one before."""
        self._before = None

    def totals(self) -> dict[str, dict[str, Any]]:
        """Return by variant: mean ``boundary_F`` over the ``frames`` that have it, and the flicker.

        Undefined is None. The baseline, whose mask is always the same, has no flicker.
        """
        return {
            name: {
                "boundary_F": own.score / own.frames if own.frames else None,
                "frames": own.frames,
                "width": self._width,
                "flicker": own.changed / own.labelled if own.labelled else None,
                "truth_flicker": own.moved / own.labelled if own.labelled else None,
                "pairs": own.pairs,
            }
            for name, own in self._sums.items()
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
        p, q = ones(edge), ones(true_edge)
        if not p or not q:
            scores[name] = 0.0 if p or q else math.nan
            continue
        precision = ones(edge & near_truth) / p
        recall = ones(true_edge & grow(edge, disk(width), truth)) / q
        both = precision + recall
        scores[name] = 2 * precision * recall / both if both else 0.0
    return scores


def edge_of(labels: TruthBits) -> Bits:
    """Mark the road pixels that touch non-road, by side or corner: ``(H, words)``.

    Neither the image's border nor an ignored pixel makes an edge.
    """
    return labels.road & grow(labels.other, square(1), labels)
