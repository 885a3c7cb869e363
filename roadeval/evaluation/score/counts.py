"""Pixels by outcome (section 5), counted and summed over frames; edges, flicker and episodes."""

from __future__ import annotations

import math
from array import array
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import pairwise, zip_longest
from operator import itemgetter
from typing import Any, Final, NamedTuple

import numpy as np

from roadeval.data import (
    ERRORS,
    FINAL_STAGE,
    OUTCOMES,
    Contour,
    FrameResult,
    Layer,
    Mask,
    Packed,
    Role,
    Tally,
    Truth,
    TruthBits,
    everywhere,
    ones,
)
from roadeval.data.arrays import IGNORED, Bits, Floats, Sums
from roadeval.data.result import Cells
from roadeval.evaluation import metrics
from roadeval.evaluation.region import disk, grow, square
from roadeval.evaluation.stats import CameraRates
from roadeval.kernels import KERNELS

Name = tuple[str, str]
"""A mask's variant and stage."""
FourCounts = Sums
"""``(n, 4)``: TP, TN, FP, FN of each frame."""
Total = dict[str, Any]
"""See `sum_up`."""


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


class FrameCounts(NamedTuple):
    """The counts of one stage of one variant, frame by frame."""

    variant: str
    stage: str
    frames: Sums
    """``(n,)`` int64: frame numbers, rising. A mask that the log itself carries may be missing on
    some."""
    stamps: Sums
    """``(n,)`` int64, nanoseconds."""
    counts: FourCounts

    @property
    def name(self) -> Name:
        """Its variant and stage."""
        return self.variant, self.stage

    @property
    def rates(self) -> Floats:
        """``(n, m)`` float64: the rates in the order of `roadeval.evaluation.metrics.METRICS`."""
        return metrics.table(self.counts)

    def take(self, places: Cells) -> FrameCounts:
        """Return it on the frames at some places."""
        arrays = (each[places] for each in (self.frames, self.stamps, self.counts))
        return FrameCounts(self.variant, self.stage, *arrays)

    def paired(self, base: FrameCounts) -> CameraRates:
        """Return the rates of this mask and of the base on the frames that both have."""
        _, mine, theirs = np.intersect1d(self.frames, base.frames, return_indices=True)
        return CameraRates(self.stamps[mine], self.rates[mine], base.rates[theirs])


Camera = Sequence[FrameCounts]
"""The masks of a camera of a drive."""


class GrowingCounts:
    """The counts of masks, added frame by frame: 20 bytes each."""

    def __init__(self) -> None:
        self._rows: Final[defaultdict[Name, array[int]]] = defaultdict(partial(array, "I"))

    def add(self, frame: int, tallies: Iterable[Tally]) -> None:
        """Add the evaluated frame of a number; they come in order."""
        for each in tallies:
            self._rows[each.variant, each.stage].extend((frame, *each.counts))

    def so_far(self, when: Sums) -> dict[Name, FrameCounts]:
        """Return what was added, mask by mask as they first came.

        ``when`` are ``(n, 2)`` int64: number and stamp of each frame, rising.
        """
        found = {}
        for name, rows in self._rows.items():
            own = np.array(rows, np.int64).reshape(-1, 5)
            places = np.searchsorted(when[:, 0], own[:, 0])
            frames, stamps = when[places].T
            found[name] = FrameCounts(*name, frames, stamps, own[:, 1:])
        return found


class RegionSums:
    """Totals of each mask and region, without keeping the frames."""

    def __init__(self) -> None:
        size = 1 + len(OUTCOMES) + 2 * len(metrics.METRICS)
        self._sums = defaultdict[tuple[str, str, str], Floats](lambda: np.zeros(size))
        """Frames, counts, sums of rates, and on how many frames each rate is defined."""

    def add(self, tallies: Sequence[Tally]) -> None:
        """Add a frame; a region without a labelled pixel does not count."""
        found = {
            (t.variant, t.stage, name): own for t in tallies for name, own in t.regions.items()
        }
        counts = np.array([*found.values()], np.int64).reshape(-1, 4)
        rates = metrics.table(counts)
        known = ~np.isnan(rates)
        columns = counts.any(axis=1), counts, np.where(known, rates, 0.0), known
        for name, row in zip(found, np.column_stack(columns), strict=True):
            self._sums[name] += row

    def totals(self) -> dict[tuple[str, str, str], Total]:
        """Sum up by variant, stage and region: see `sum_up`."""
        first = 1 + len(OUTCOMES)
        return {
            name: _total(int(row[0]), row[1:first].astype(np.int64), *row[first:].reshape(2, -1))
            for name, row in self._sums.items()
        }


def sum_up(counts: FourCounts) -> Total:
    """Sum up a drive: frames, counts, mean rates (the paper's), pooled rates, undefined ones.

    A rate that is undefined on a frame is left out of its mean, and counted in ``undefined``. IoU
    and its like, which are no columns of tables, are among both kinds of rates.
    """
    rates, overlap = metrics.table(counts), metrics.table(counts, metrics.OVERLAP)
    known = ~np.isnan(rates)
    sums = np.where(known, rates, 0.0).sum(axis=0)
    total = _total(len(counts), counts.sum(axis=0), sums, known.sum(axis=0))
    undefined = dict(zip(metrics.OVERLAP, np.isnan(overlap).sum(axis=0).tolist(), strict=True))
    return {
        **total,
        **means(overlap, metrics.OVERLAP),
        **metrics.pooled(counts.sum(axis=0), metrics.OVERLAP),
        "undefined": total["undefined"] | undefined,
    }


def over_cameras(totals: Sequence[Total]) -> Total:
    """Return the total of cameras together: means of the cameras' means, and pooled pixels."""
    counts = np.sum([[each[name] for name in OUTCOMES] for each in totals], axis=0)
    frames = sum(each["frames"] for each in totals)
    found = _total(frames, counts, *np.zeros((2, len(metrics.METRICS))))
    names = (*metrics.METRICS, *metrics.OVERLAP)
    rates = np.array([[each[name] for name in names] for each in totals])
    undefined = {name: sum(each["undefined"][name] for each in totals) for name in names}
    overlap = metrics.pooled(counts, metrics.OVERLAP)
    return {**found, **means(rates, names), **overlap, "undefined": undefined}


def means(rates: Floats, names: Iterable[str] = metrics.METRICS) -> dict[str, float]:
    """Average the named rates over frames, ``(n, m)``; NaN where a rate is defined on none."""
    known = ~np.isnan(rates)
    return _means(np.where(known, rates, 0.0).sum(axis=0), known.sum(axis=0), names)


def _means(
    sums: Floats, defined: Cells, names: Iterable[str] = metrics.METRICS
) -> dict[str, float]:
    average = np.divide(sums, defined, out=np.full(len(sums), np.nan), where=defined > 0)
    return dict(zip(names, average.tolist(), strict=True))


def _total(frames: int, counts: FourCounts, sums: Floats, defined: Cells) -> Total:
    undefined = (frames - defined.astype(np.int64)).tolist()
    return {
        "frames": frames,
        **dict(zip((*OUTCOMES, "N"), (*counts.tolist(), counts.sum().item()), strict=True)),
        **_means(sums, defined),
        **metrics.pooled(counts),
        "undefined": dict(zip(metrics.METRICS, undefined, strict=True)),
    }


def windows(masks: Sequence[FrameCounts], size: int) -> list[dict[str, Any]]:
    """Cut a drive into windows of ``size`` consecutive evaluated frames.

    Returned are the rows of ``windows.csv``, by window and then mask. Frames are evaluated where
    any of the masks is; of windows with fewer than ``size`` the last is one. Rates are the means of
    the frames', an undefined one left out (the paper's average), those of ``pooled_*`` are of the
    summed counts.
    """
    numbers = np.unique(np.concatenate([np.zeros(0, np.int64), *(mask.frames for mask in masks)]))
    rows = []
    for mask in masks:
        window_of, rates = np.searchsorted(numbers, mask.frames) // size, mask.rates
        for window in np.unique(window_of).tolist():
            here = slice(*np.searchsorted(window_of, [window, window + 1]))
            frames = numbers[window * size : (window + 1) * size].tolist()
            rows.append(
                {
                    "window": window,
                    "first_frame": frames[0],
                    "last_frame": frames[-1],
                    "frames": here.stop - here.start,
                    "variant": mask.variant,
                    "stage": mask.stage,
                    **means(rates[here]),
                    **metrics.pooled(mask.counts[here].sum(axis=0)),
                }
            )
    return sorted(rows, key=itemgetter("window"))


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


def final_stages(masks: Iterable[Name]) -> dict[str, str]:
    """Return each variant's final stage: ``post``, or the last that it has.

    ``masks`` are in the order in which the stages ran.
    """
    finals: dict[str, str] = {}
    for variant, stage in masks:
        if finals.get(variant) != FINAL_STAGE:
            finals[variant] = stage
    return finals
