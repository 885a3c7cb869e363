"""Pixels by outcome (section 5), counted and summed over frames; edges, flicker and episodes."""

from __future__ import annotations

import math
from array import array
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise, zip_longest
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from roadeval.data import (
    ERRORS,
    OUTCOMES,
    Contour,
    Counts,
    FrameResult,
    Layer,
    Mask,
    Packed,
    Role,
    Truth,
    TruthBits,
    everywhere,
    ones,
)
from roadeval.data.arrays import IGNORED, Bits, Floats, Sums
from roadeval.evaluation import metrics
from roadeval.evaluation.region import disk, grow, square
from roadeval.evaluation.tables import rates_of
from roadeval.kernels import KERNELS

if TYPE_CHECKING:
    import pandas as pd

Name = tuple[str, str]
"""A mask's variant and stage."""


def count(masks: Bits, truth: TruthBits, regions: Sequence[Bits]) -> Sums:
    """Count TP, TN, FP and FN of each mask, in the whole frame and in each region.

    ``masks`` are ``(K, H, words)``: road. Ignored pixels are in no count. ``regions`` are R of
    ``(H, words)``, which may overlap. Returned are ``(K, 1 + R, 4)`` int64: of each mask the whole
    frame's four, then each region's.
    """
    inside = flat([everywhere(truth.shape), *regions])
    classes = flat([truth.road, truth.other])
    positives, negatives = KERNELS.count_bits(inside[:1], classes, inside)[0]
    tp, fp = KERNELS.count_bits(flat(masks), classes, inside).transpose(1, 0, 2)
    return np.stack([tp, negatives - fp, fp, positives - tp], axis=2)


def error_map(mask: Mask, truth: Truth) -> Layer:
    """Classify each pixel by its outcome, as in `roadeval.data.ERRORS`.

    ``mask`` is ``(H, W)`` uint8, 0 or 1; ``truth`` too, and 255 where it is ignored.
    """
    # TN 0 and TP 1 where the two agree, FP 2 and FN 3 where not; beyond 4 what is ignored.
    return Layer(ERRORS, np.minimum(truth + 2 * (truth ^ mask), np.uint8(IGNORED)))


def flat(masks: Bits | Sequence[Bits]) -> Bits:
    """Lay each mask's rows one after the other: ``(K, H * words)``."""
    stacked = np.asarray(masks, np.uint64)
    return stacked.reshape(len(stacked), stacked.shape[1] * stacked.shape[2])


class CountedRows:
    """Counts of masks, added frame by frame: 24 bytes a mask and frame, until they are a table."""

    def __init__(self, *names: str) -> None:
        self._names: Final = names
        """Which names a row has, such as variant and stage."""
        self._rows: Final = array("I")
        """Place of the frame, place of its names, and the four counts, again and again."""
        self._places: Final[dict[tuple[str, ...], int]] = {}

    def add(self, place: int, counts: Iterable[tuple[tuple[str, ...], Counts]]) -> None:
        """Add the counts of the evaluated frame at a place, by their names."""
        for names, four in counts:
            row = self._places.setdefault(names, len(self._places))
            self._rows.extend((place, row, *four))

    def table(self, when: pd.DataFrame, orders: Mapping[str, Sequence[str]]) -> pd.DataFrame:
        """Return the rows with their rates, as they came.

        ``when`` has what is known of each frame at its place; ``orders`` are by column the order of
        names that are not in that of their first row.
        """
        import pandas as pd

        rows = np.array(self._rows, np.int64).reshape(-1, 6)
        table = when.iloc[rows[:, 0]].reset_index(drop=True)
        columns = [*zip(*self._places, strict=True)] or [()] * len(self._names)
        for name, words in zip(self._names, columns, strict=True):
            order = orders.get(name) or [*dict.fromkeys(words)]
            codes = np.array([order.index(word) for word in words], np.int64)[rows[:, 1]]
            table[name] = pd.Categorical.from_codes(codes, pd.Index([*order]))
        table[[*OUTCOMES]] = rows[:, 2:]
        table["N"] = rows[:, 2:].sum(axis=1)
        return table.join(rates_of(table, metrics.METRICS))


def episodes(stamps: Sums, errors: Floats, limit: float) -> dict[str, Any]:
    """Return for how long a drive's ERR was at or above a limit, and when it recovered.

    ``stamps`` are ``(n,)`` nanoseconds of evaluated frames, ``errors`` their ERR; one that is NaN
    says nothing. An episode lasts from its first frame to the first one below the limit, where it
    has ``recovered``. Where the drive's end or a gap comes before, of more than a second and three
    usual steps, it has not, and lasts to its last frame. Times are in seconds, those of gaps in
    none; ``share`` is of the drive, ``recovery`` the median of the episodes that recovered.
    """
    known = np.flatnonzero(~np.isnan(errors))
    known = known[np.argsort(stamps[known], kind="stable")]
    steps = np.diff(stamps[known])
    gap = max(1_000_000_000, 3 * np.median(steps)) if len(steps) else 0
    lasting, times, recovered = False, [0.0] * 0, [0.0] * 0
    for error, step in zip_longest(errors[known].tolist(), steps.tolist(), fillvalue=math.inf):
        if error >= limit and not lasting:
            times.append(0)
        elif error < limit and lasting:
            recovered.append(times[-1])
        lasting = error >= limit and step <= gap
        if lasting:
            times[-1] += step
    return {
        "limit": limit,
        "episodes": len(times),
        "recovered": len(recovered),
        "seconds": sum(times) / 1e9,
        "share": sum(times) / (int(steps[steps <= gap].sum()) or math.nan),
        "longest": max(times, default=0) / 1e9,
        "recovery": float(np.median(recovered)) / 1e9 if recovered else None,
    }


TRIMAP: Final = (1, 2, 4, 8, 16, 32)
"""Widths around the truth's edge, in pixels, in which errors are counted."""


class _Sums(NamedTuple):
    """Of one variant."""

    scores: Floats
    frames: Sums
    """``(2,)``: boundary F and boundary IoU, and the frames that have each."""
    trimap: Sums
    pairs: Sums
    """``(4,)``: pairs of frames; the pixels that both label; where the mask, and where the truth
    changes."""


def _no_sums() -> _Sums:
    shapes = (2,), (len(TRIMAP), 2), (4,)
    return _Sums(np.zeros(2), *(np.zeros(shape, np.int64) for shape in shapes))


class EdgesAndFlicker:
    """Sums up boundary F, boundary IoU, trimap and flicker of every final mask.

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
        self._width = width
        self._sums = defaultdict[str, _Sums](_no_sums)
        self._before: tuple[TruthBits, Mapping[str, Packed]] | None = None

    def add(self, result: FrameResult) -> None:
        """Add a frame, in the drive's order. One that is not evaluated interrupts the flicker."""
        now = result.truth_bits
        if result.role is not Role.EVALUATED or now is None:
            self.interrupt()
            return
        for name, (*scores, counts) in result.contours.items():
            own = self._sums[name]
            own.scores[:] += np.nan_to_num(scores)
            own.frames[:] += ~np.isnan(scores)
            own.trimap[:] += counts
        masks = {v.variant: mask for v in result.variants for _, mask in v.masks()}
        before, self._before = self._before, (now, masks)
        if before is None or before[0].shape != now.shape:
            return
        labelled = now.labelled & before[0].labelled
        count, moved = ones(labelled), ones((now.road ^ before[0].road) & labelled)
        for name in masks.keys() & before[1].keys():
            changed = ones((masks[name].bits ^ before[1][name].bits) & labelled)
            self._sums[name].pairs[:] += 1, count, changed, moved

    def interrupt(self) -> None:
        """Note that the next frame does not follow the one before."""
        self._before = None

    def totals(self) -> dict[str, dict[str, Any]]:
        """Return by variant: mean ``boundary_F`` over the ``frames`` that have it, and the flicker.

        So too ``boundary_IoU``; ``trimap`` has the pixels of all frames. Undefined is None. The
        baseline, whose mask is always the same, has no flicker.
        """
        found = {}
        for name, own in self._sums.items():
            pairs, labelled, *moved = own.pairs.tolist()
            scores, frames = own.scores.tolist(), own.frames.tolist()
            f, iou = (s / n if n else None for s, n in zip(scores, frames, strict=True))
            flicker, of_truth = (pixels / labelled if labelled else None for pixels in moved)
            found[name] = {
                "boundary_F": f,
                "frames": frames[0],
                "width": self._width,
                "boundary_IoU": iou,
                "trimap": dict(zip(map(str, TRIMAP), own.trimap.tolist(), strict=True)),
                "flicker": flicker,
                "truth_flicker": of_truth,
                "pairs": pairs,
            }
        return found


def contours(
    masks: Mapping[str, Bits], truth: TruthBits, width: int, widths: Sequence[int] = TRIMAP
) -> dict[str, Contour]:
    """Compute how well masks, ``(H, words)`` each by name, follow the truth's edge.

    Boundary F is ``F = 2 P R / (P + R)`` [1]_ [2]_. P is the share of the mask's edge pixels that
    lie within ``width`` of the truth's edge, R the share of the truth's edge pixels within
    ``width`` of the mask's, in pixels of Euclidean distance. 0 if only one of the two has an edge,
    NaN if neither has.

    Boundary IoU is that of the bands of road along the two edges [3]_. A band is as wide as 2 % of
    the diagonal, in chessboard distance; as in the authors' code the image's border is an edge. NaN
    where both bands are empty.

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

    def band(own: TruthBits) -> Bits:
        inside = everywhere(truth.shape) ^ own.other
        return own.road & ~KERNELS.erode(inside, element, truth.shape[1])

    true_edge, true_band = edge_of(truth), band(truth)
    near_truth, q = grow(true_edge, disk(width), truth), ones(true_edge)
    road, other, near, found = truth.road, truth.other, [], {}
    for before, after in pairwise((0, *widths)):
        # A square grown by a square is the square of both widths.
        road, other = (grow(each, square(after - before), truth) for each in (road, other))
        near.append(road & other)
    counted = flat([labelled, *(mask ^ truth.road for mask in masks.values())])
    whole, *wrong = KERNELS.count_bits(counted, flat([labelled]), flat(near))[:, 0]
    for (name, mask), errors in zip(masks.items(), wrong, strict=True):
        own = TruthBits(truth.shape, mask & labelled, labelled & ~mask)
        edge, own_band = edge_of(own), band(own)
        p, score = ones(edge), math.nan
        if p and q:
            recall = ones(true_edge & grow(edge, disk(width), truth)) / q
            precision = ones(edge & near_truth) / p
            both = precision + recall
            score = 2 * precision * recall / both if both else 0.0
        elif p or q:
            score = 0.0
        union = ones(own_band | true_band)
        overlap = ones(own_band & true_band) / union if union else math.nan
        found[name] = score, overlap, np.stack([errors, whole], axis=1)
    return found


def edge_of(labels: TruthBits) -> Bits:
    """Mark the road pixels that touch non-road, by side or corner: ``(H, words)``.

    Neither the image's border nor an ignored pixel makes an edge.
    """
    return labels.road & grow(labels.other, square(1), labels)
