"""Every evaluated frame's counts, kept small: what rates, sums and intervals are made of."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from roadeval.data import Counts, Tally
from roadeval.evaluation import metrics


@dataclass(slots=True)
class History:
    """The results of one stage of one variant, frame by frame: 20 bytes a frame as it grows.

    A mask that the log itself carries may be missing on some frames, so each row says which
    evaluated frame it belongs to.
    """

    variant: str
    stage: str
    _positions: array[int] = field(default_factory=lambda: array("I"))
    _counts: array[int] = field(default_factory=lambda: array("I"))

    @classmethod
    def of_table(
        cls,
        variant: str,
        stage: str,
        positions: npt.NDArray[np.int64],
        counts: npt.NDArray[np.int64],
    ) -> History:
        """Make a history of what the properties `positions` and `counts` gave."""
        # A file's counts may be larger than any frame.
        return cls(
            variant, stage, array("q", positions.tolist()), array("q", counts.ravel().tolist())
        )

    def append(self, position: int, tally: Tally) -> None:
        """Add the tally of the evaluated frame number ``position``, counted from 0."""
        counts = tally.counts
        self._positions.append(position)
        self._counts.extend((counts.tp, counts.tn, counts.fp, counts.fn))

    @property
    def positions(self) -> npt.NDArray[np.int64]:
        """``(n,)`` int64: places among the evaluated frames, rising."""
        return np.array(self._positions, np.int64)

    @property
    def counts(self) -> npt.NDArray[np.int64]:
        """``(n, 4)`` int64: TP, TN, FP, FN."""
        return np.array(self._counts, np.int64).reshape(-1, 4)

    @property
    def rates(self) -> npt.NDArray[np.float64]:
        """``(n, m)`` float64: the rates in the order of `roadeval.evaluation.metrics.METRICS`."""
        return metrics.table(self.counts)

    def totals(self) -> dict[str, Any]:
        """Sum up the drive: counts, mean rates (the paper's), pooled rates, undefined ones.

        A rate that is undefined on a frame is left out of its mean, and counted in ``undefined``.
        """
        pooled, table = Counts(*self.counts.sum(axis=0).tolist()), self.rates
        undefined = np.isnan(table).sum(axis=0).tolist()
        return {
            "frames": len(self._positions),
            **columns(pooled),
            **means(table),
            **{f"pooled_{name}": value for name, value in metrics.of(pooled).items()},
            "undefined": dict(zip(metrics.METRICS, undefined, strict=True)),
        }


def columns(counts: Counts) -> dict[str, int]:
    """Name the counts as the tables do: TP, TN, FP, FN, N."""
    return {"TP": counts.tp, "TN": counts.tn, "FP": counts.fp, "FN": counts.fn, "N": counts.n}


def means(table: npt.NDArray[np.float64]) -> dict[str, float]:
    """Average rates over frames, ``(n, m)``; NaN where a rate is defined on none."""
    defined = ~np.isnan(table)
    sums = np.where(defined, table, 0.0).sum(axis=0)
    average = np.divide(
        sums, defined.sum(axis=0), out=np.full(len(sums), np.nan), where=defined.any(axis=0)
    )
    return dict(zip(metrics.METRICS, average.tolist(), strict=True))
