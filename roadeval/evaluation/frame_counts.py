"""Every evaluated frame's counts of one mask: what rates, sums and intervals are made of."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from roadeval.data import FILTERED, UNFILTERED, Counts
from roadeval.evaluation import metrics

FourCounts = npt.NDArray[np.int64]
"""``(n, 4)``: TP, TN, FP, FN of each frame."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameCounts:
    """The counts of one stage of one variant, frame by frame.

    Parameters
    ----------
    variant, stage
        Whose mask.
    positions
        ``(n,)`` int64: places among the evaluated frames, rising. A mask that the log itself
        carries may be missing on some.
    counts
        ``(n, 4)`` int64: TP, TN, FP, FN.
    """

    variant: str
    stage: str
    positions: npt.NDArray[np.int64]
    counts: FourCounts

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
        "TP": pooled.tp,
        "TN": pooled.tn,
        "FP": pooled.fp,
        "FN": pooled.fn,
        "N": pooled.n,
        **means(rates),
        **{f"pooled_{name}": value for name, value in metrics.of(pooled).items()},
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
