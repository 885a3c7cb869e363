"""Pixels of a frame by outcome (section 5), changes from mask to mask, edges and flicker."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import chain, pairwise, permutations
from typing import Any, Final

import numpy as np

from roadeval import data
from roadeval.data import ERRORS, TruthBits, everywhere, ones
from roadeval.data.arrays import IGNORED, Bits, Sums
from roadeval.evaluation.region import disk, grow, square
from roadeval.kernels import KERNELS

Name = tuple[str, str]
"""A mask's variant and stage."""


def count(masks: Bits, truth: TruthBits, regions: Sequence[Bits]) -> Sums:
    """Count TP, TN, FP and FN of each mask, in the whole frame and in each region.

    ``masks`` are ``(K, H, words)``, set for road. ``regions`` are R masks, ``(H, words)`` each, and
    may overlap. The result is ``(K, 1 + R, 4)`` int64: for each mask the four counts of the
    whole frame, then of each region. Ignored pixels are in no count.
    """
    inside = flat([everywhere(truth.shape), *regions])
    classes = flat([truth.road, truth.other])
    positives, negatives = KERNELS.count_bits(inside[:1], classes, inside)[0]
    tp, fp = KERNELS.count_bits(flat(masks), classes, inside).transpose(1, 0, 2)
    return np.stack([tp, negatives - fp, fp, positives - tp], axis=2)


def error_map(mask: data.Mask, truth: data.Truth) -> data.Layer:
    """Classify each pixel by its outcome, as in `roadeval.data.ERRORS`.

    ``mask`` is ``(H, W)`` uint8, 0 or 1; ``truth`` also has 255 for ignored pixels.
    """
    # TN 0 and TP 1 where the two agree, else FP 2 and FN 3; ignored pixels get more than 4.
    return data.Layer(ERRORS, np.minimum(truth + 2 * (truth ^ mask), np.uint8(IGNORED)))


def flat(masks: Bits | Sequence[Bits]) -> Bits:
    """Concatenate the rows of each mask: ``(K, H * words)``."""
    stacked = np.asarray(masks, np.uint64)
    return stacked.reshape(len(stacked), stacked.shape[1] * stacked.shape[2])


def changes(
    names: Sequence[Name], masks: Bits, truth: TruthBits
) -> dict[data.Transition, data.Change]:
    """Count the changes from each stage's mask to the next, and between final masks.

    ``names`` are variant and stage of each mask, a variant's stages in the order they ran;
    ``masks`` are ``(K, H, words)``. Ignored pixels are in no count.
    """
    labelled = truth.labelled
    wrong = flat((masks ^ truth.road) & labelled)
    both = KERNELS.count_bits(wrong, wrong, flat([everywhere(truth.shape)]))[..., 0].tolist()
    steps = [(n, n + 1) for n in range(len(names) - 1) if names[n][0] == names[n + 1][0]]
    finals = {variant: place for place, (variant, _) in enumerate(names)}
    pixels, transitions = ones(labelled), {}
    for before, after in chain(steps, permutations(finals.values(), 2)):
        repaired, spoiled = (both[place][place] - both[before][after] for place in (before, after))
        transitions[*names[before], *names[after]] = data.Change(repaired, spoiled, pixels)
    return transitions


TRIMAP: Final = (1, 2, 4, 8, 16, 32)
"""Widths around the truth's edge, in pixels, in which errors are counted."""


class _VariantSums:
    """Sums over the frames of one variant."""

    def __init__(self) -> None:
        self.scores = np.zeros(2)
        self.frames = np.zeros(2, np.int64)
        """Boundary F and boundary IoU, and the frames that have each."""
        self.trimap = np.zeros((len(TRIMAP), 2), np.int64)
        self.pairs = np.zeros(4, np.int64)
        """Numbers of pairs of frames, of pixels labelled in both, and of pixels that change in the
        mask and in the truth."""


class EdgesAndFlicker:
    """Sums up boundary F, boundary IoU, trimap and flicker of every final mask.

    ``flicker = sum |m_t != m_(t-1)| / sum |L_t|`` over all pairs of consecutive frames, where
    ``L_t`` are the pixels that both truths label. ``truth_flicker`` is the truth's flicker: moving
    objects must change, so only what exceeds it is flicker. Motion is not removed by optical flow,
    as it is in [1]_. ``width`` is the tolerance of boundary F in pixels.

    References
    ----------
    .. [1] S. Varghese et al., Unsupervised Temporal Consistency Metric for Video Segmentation in
       Highly-Automated Driving, CVPR Workshops 2020.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._sums = defaultdict[str, _VariantSums](_VariantSums)
        self._before: tuple[TruthBits, Mapping[str, data.Packed]] | None = None

    def add(self, result: data.FrameResult) -> None:
        """Add a frame, in the drive's order. One that is not evaluated interrupts the flicker."""
        now = result.truth_bits
        if result.role is not data.Role.EVALUATED or now is None:
            self.interrupt()
            return
        for name, (*scores, counts) in result.contours.items():
            sums = self._sums[name]
            sums.scores += np.nan_to_num(scores)
            sums.frames += ~np.isnan(scores)
            sums.trimap += counts
        masks = {v.variant: mask for v in result.variants for _, mask in v.masks()}
        before, self._before = self._before, (now, masks)
        if before is None or before[0].shape != now.shape:
            return
        labelled = now.labelled & before[0].labelled
        count, moved = ones(labelled), ones((now.road ^ before[0].road) & labelled)
        for name in masks.keys() & before[1].keys():
            changed = ones((masks[name].bits ^ before[1][name].bits) & labelled)
            self._sums[name].pairs += 1, count, changed, moved

    def interrupt(self) -> None:
        """Note that the next frame does not follow the one before."""
        self._before = None

    def totals(self) -> dict[str, dict[str, Any]]:
        """Return the means and sums by variant; None if undefined.

        ``boundary_F`` and ``boundary_IoU`` are means over the frames that have them, ``trimap`` has
        the pixels of all frames. The baseline has no flicker, because its mask is always the same.
        """
        totals = {}
        for name, sums in self._sums.items():
            pairs, labelled, *moved = sums.pairs.tolist()
            scores, frames = sums.scores.tolist(), sums.frames.tolist()
            f, iou = (s / n if n else None for s, n in zip(scores, frames, strict=True))
            flicker, of_truth = (pixels / labelled if labelled else None for pixels in moved)
            totals[name] = {
                "boundary_F": f,
                "frames": frames[0],
                "width": self._width,
                "boundary_IoU": iou,
                "trimap": dict(zip(map(str, TRIMAP), sums.trimap.tolist(), strict=True)),
                "flicker": flicker,
                "truth_flicker": of_truth,
                "pairs": pairs,
            }
        return totals


def contours(
    masks: Mapping[str, Bits], truth: TruthBits, width: int, widths: Sequence[int] = TRIMAP
) -> dict[str, data.Contour]:
    """Compute how well masks, ``(H, words)`` each by name, follow the truth's edge.

    Boundary F is ``F = 2 P R / (P + R)`` [1]_ [2]_. P is the share of the mask's edge pixels that
    lie within ``width`` of the truth's edge, R the share of the truth's edge pixels within
    ``width`` of the mask's, in pixels of Euclidean distance. It is 0 if only one of the two has an
    edge, NaN if neither has.

    Boundary IoU is the IoU of the bands of road along the two edges [3]_. A band is as wide as 2 %
    of the diagonal, in chessboard distance; as in the authors' code the image's border is an edge.
    It is NaN if both bands are empty.

    The trimap [4]_, ``(w, 2)``, counts the wrong pixels and all labelled ones within ``widths``,
    rising, of the truth's edge: a pixel is within a width if the square of side ``2 * width + 1``
    around it holds both road and non-road.

    Ignored pixels are on neither side of an edge, and in no count.

    References
    ----------
    .. [1] G. Csurka et al., What is a good evaluation measure for semantic segmentation?, BMVC
       2013.
    .. [2] F. Perazzi et al., A Benchmark Dataset and Evaluation Methodology for Video Object
       Segmentation, CVPR 2016, section 5.
    .. [3] B. Cheng et al., Boundary IoU, CVPR 2021.
    .. [4] P. Kohli et al., Robust Higher Order Potentials for Enforcing Label Consistency, IJCV 82,
       2009.
    """
    labelled, element = truth.labelled, square(max(1, round(0.02 * math.hypot(*truth.shape))))

    def band(labels: TruthBits) -> Bits:
        inside = everywhere(truth.shape) ^ labels.other
        return labels.road & ~KERNELS.erode(inside, element, truth.shape[1])

    true_edge, true_band = edge_of(truth), band(truth)
    near_truth, q = grow(true_edge, disk(width), truth), ones(true_edge)
    road, other, near, by_mask = truth.road, truth.other, [], {}
    for before, after in pairwise((0, *widths)):
        # Dilating by one square, then by another, is dilating by a square of both widths.
        road, other = (grow(side, square(after - before), truth) for side in (road, other))
        near.append(road & other)
    counted = flat([labelled, *(mask ^ truth.road for mask in masks.values())])
    pixels, *wrong = KERNELS.count_bits(counted, flat([labelled]), flat(near))[:, 0]
    for (name, mask), errors in zip(masks.items(), wrong, strict=True):
        labels = TruthBits(truth.shape, mask & labelled, labelled & ~mask)
        edge, mask_band = edge_of(labels), band(labels)
        p, score = ones(edge), math.nan
        if p and q:
            recall = ones(true_edge & grow(edge, disk(width), truth)) / q
            precision = ones(edge & near_truth) / p
            both = precision + recall
            score = 2 * precision * recall / both if both else 0.0
        elif p or q:
            score = 0.0
        union = ones(mask_band | true_band)
        overlap = ones(mask_band & true_band) / union if union else math.nan
        by_mask[name] = score, overlap, np.stack([errors, pixels], axis=1)
    return by_mask


def edge_of(labels: TruthBits) -> Bits:
    """Return the road pixels that touch non-road, by side or corner: ``(H, words)``.

    Neither the image's border nor an ignored pixel makes an edge.
    """
    return labels.road & grow(labels.other, square(1), labels)
