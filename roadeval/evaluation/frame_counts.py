"""Every evaluated frame's counts of one mask: what rates, sums and intervals are made of."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from roadeval.data import FILTERED, OUTCOMES, UNFILTERED, Counts, Tally
from roadeval.evaluation import metrics

FourCounts = npt.NDArray[np.int64]
"""``(n, 4)``: TP, TN, FP, FN of each frame."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameCounts:
    """The counts of one stage of one variant, frame by frame."""

    variant: str
    stage: str
    """Whose mask."""
    positions: npt.NDArray[np.int64]
    """``(n,)`` int64: places among the evaluated frames, rising. A mask that the log itself carries
    may be missing on some.
    """
    counts: FourCounts
    """``(n, 4)`` int64: TP, TN, FP, FN."""

    @property
    def rates(self) -> npt.NDArray[np.float64]:
        """``(n, m)`` float64: the rates in the order of `roadeval.evaluation.metrics.METRICS`."""
        return metrics.table(self.counts)


class GrowingCounts:
    """Counts of one mask as they come, 20 bytes a frame."""

    def __init__(self) -> None:
        self._positions = array("I")
        self._counts = array("I")

    def append(self, position: int, counts: Counts) -> None:
        """Add the counts of the evaluated frame at ``position``, counted from 0."""
        self._positions.append(position)
        self._counts.extend((counts.tp, counts.tn, counts.fp, counts.fn))

    def so_far(self, variant: str, stage: str) -> FrameCounts:
        """Return what was added, as counts of this mask."""
        counts = np.array(self._counts, np.int64).reshape(-1, 4)
        return FrameCounts(variant, stage, np.array(self._positions, np.int64), counts)


class RegionSums:
    """Counts of each mask and region, summed up over frames, and the means of the frames' rates."""

    def __init__(self) -> None:
        self._places: dict[tuple[str, str, str], int] = {}
        self._frames = np.zeros(0, np.int64)
        self._counts = np.zeros((0, 4), np.int64)
        self._rates = np.zeros((0, len(metrics.METRICS)))
        self._defined = np.zeros((0, len(metrics.METRICS)), np.int64)

    def add(self, tallies: Sequence[Tally]) -> None:
        """Add a frame; a region without a labelled pixel does not count."""
        found = {
            (tally.variant, tally.stage, region): (own.tp, own.tn, own.fp, own.fn)
            for tally in tallies
            for region, own in tally.regions.items()
        }
        places = [self._places.setdefault(name, len(self._places)) for name in found]
        if len(self._places) > len(self._frames):
            more = len(self._places) - len(self._frames)
            for name in ("_frames", "_counts", "_rates", "_defined"):
                sums = getattr(self, name)
                grown = np.concatenate([sums, np.zeros((more, *sums.shape[1:]), sums.dtype)])
                setattr(self, name, grown)
        counts = np.array([*found.values()], np.int64).reshape(-1, 4)
        rates = metrics.table(counts)
        known = ~np.isnan(rates)
        self._frames[places] += counts.any(axis=1)
        self._counts[places] += counts
        self._rates[places] += np.where(known, rates, 0.0)
        self._defined[places] += known

    def totals(self) -> dict[tuple[str, str, str], dict[str, Any]]:
        """Return frames, counts, means and pooled rates by variant, stage and region."""
        means = np.divide(
            self._rates,
            self._defined,
            out=np.full(self._rates.shape, np.nan),
            where=self._defined > 0,
        )
        return {
            name: {
                "frames": int(self._frames[place]),
                **_summed(Counts(*self._counts[place].tolist())),
                **dict(zip(metrics.METRICS, means[place].tolist(), strict=True)),
                **_pooled(Counts(*self._counts[place].tolist())),
            }
            for name, place in self._places.items()
        }


def _summed(counts: Counts) -> dict[str, int]:
    own = (counts.tp, counts.tn, counts.fp, counts.fn, counts.n)
    return dict(zip((*OUTCOMES, "N"), own, strict=True))


def _pooled(counts: Counts) -> dict[str, float]:
    return {f"pooled_{name}": value for name, value in metrics.of(counts).items()}


def paired(masks: Sequence[FrameCounts]) -> Iterator[tuple[str, npt.NDArray[np.float64]]]:
    """Yield each stage of both default variants with the ``(n, m)`` differences of its rates.

    Filtered minus unfiltered, on the frames that both have.
    """
    named = {(mask.variant, mask.stage): mask for mask in masks}
    for (variant, stage), treated in named.items():
        control = named.get((UNFILTERED, stage))
        if variant == FILTERED and control is not None:
            _, mine, theirs = np.intersect1d(
                treated.positions, control.positions, return_indices=True
            )
            yield stage, treated.rates[mine] - control.rates[theirs]


def sum_up(counts: FourCounts) -> dict[str, Any]:
    """Sum up a drive: counts, mean rates (the paper's), pooled rates, undefined ones.

    A rate that is undefined on a frame is left out of its mean, and counted in ``undefined``.
    """
    pooled, rates = Counts(*counts.sum(axis=0).tolist()), metrics.table(counts)
    undefined = np.isnan(rates).sum(axis=0).tolist()
    return {
        "frames": len(counts),
        **_summed(pooled),
        **means(rates),
        **_pooled(pooled),
        "undefined": dict(zip(metrics.METRICS, undefined, strict=True)),
    }


def means(rates: npt.NDArray[np.float64]) -> dict[str, float]:
    """Average rates over frames, ``(n, m)``; NaN where a rate is defined on none."""
    defined = ~np.isnan(rates)
    sums = np.where(defined, rates, 0.0).sum(axis=0)
    average = np.divide(
        sums, defined.sum(axis=0), out=np.full(len(sums), np.nan), where=defined.any(axis=0)
    )
    return dict(zip(metrics.METRICS, average.tolist(), strict=True))


@dataclass(frozen=True, slots=True)
class Window:
    """One stage of one variant over consecutive evaluated frames."""

    number: int
    """From 0."""
    first_frame: int
    last_frame: int
    """Frame numbers of the window's ends, both inclusive."""
    frames: int
    """Evaluated frames that have this mask; the last window may hold fewer than the others."""
    variant: str
    stage: str
    """Whose mask."""
    rates: dict[str, float]
    """Mean of the frames' rates, an undefined one left out (the paper's average)."""
    pooled: dict[str, float]
    """The rates of the summed counts."""


def cut(mask: FrameCounts, frame_numbers: Sequence[int], size: int) -> Iterator[Window]:
    """Cut a drive into windows of ``size`` consecutive evaluated frames.

    Parameters
    ----------
    mask
        The counts of one stage of one variant.
    frame_numbers
        The numbers of all evaluated frames, in order.
    size
        Frames in a window.
    """
    window_of, rates = mask.positions // size, mask.rates
    for number in np.unique(window_of).tolist():
        here = slice(*np.searchsorted(window_of, [number, number + 1]))
        last = min((number + 1) * size, len(frame_numbers)) - 1
        yield Window(
            number=number,
            first_frame=frame_numbers[number * size],
            last_frame=frame_numbers[last],
            frames=here.stop - here.start,
            variant=mask.variant,
            stage=mask.stage,
            rates=means(rates[here]),
            pooled=metrics.of(Counts(*mask.counts[here].sum(axis=0).tolist())),
        )
