"""The curves over thresholds of a drive, summed up frame by frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from roadeval.data import Histogram
from roadeval.evaluation.maps import Name
from roadeval.evaluation.thresholds import (
    Sums,
    Thresholds,
    average_precision,
    calibration,
    expected_calibration_error,
    max_f,
    roc_auc,
)


class Curves:
    """The labelled pixels of a drive by how probable road is, for each variant and stage.

    Attributes
    ----------
    counts
        ``(2, 65536)`` int64 by variant and stage: non-road and road.
    """

    def __init__(self) -> None:
        self.counts: Final[dict[Name, Sums]] = {}
        self._frames: Final[Counter[Name]] = Counter()

    def add(self, histograms: Mapping[Name, Histogram]) -> None:
        """Add the histograms of a frame."""
        for name, counts in histograms.items():
            self._frames[name] += 1
            if name not in self.counts:
                self.counts[name] = np.zeros(counts.shape, np.int64)
            self.counts[name] += counts

    def totals(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Return by variant and stage what is quoted of curves, fit for JSON.

        ``AP``, ``AUC`` and ``ECE``; ``MaxF`` with the ``threshold`` where it is reached, and the
        ``precision`` and ``recall`` there; the ``bins`` of the reliability diagram.
        """
        found: dict[str, dict[str, dict[str, Any]]] = {}
        for (variant, stage), counts in self.counts.items():
            own = {"frames": self._frames[variant, stage], **_quoted(counts)}
            found.setdefault(variant, {})[stage] = own
        return found


def _quoted(counts: Sums) -> dict[str, Any]:
    thresholds, bins = Thresholds.of(counts), calibration(counts)
    best = max_f(thresholds)
    return {
        "AP": average_precision(thresholds),
        "AUC": roc_auc(thresholds),
        "MaxF": None if best is None else best.f,
        "threshold": None if best is None else best.threshold,
        "precision": None if best is None else best.precision,
        "recall": None if best is None else best.recall,
        "ECE": expected_calibration_error(bins),
        "bins": [asdict(each) for each in bins],
    }
