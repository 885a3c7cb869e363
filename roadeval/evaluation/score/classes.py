"""The classes of the truth: how much of each is called road, and the missed road beside it."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from roadeval.data import NO_CLASS, NON_ROAD, ROAD, Classes, Mask, Moment, Truth, TruthClass
from roadeval.data.arrays import Sums
from roadeval.evaluation.tables import separate

BESIDE: Final = 75
"""Missed road within a 75th of the diagonal lies beside a class: within 8 pixels at 480x360."""
SHOWN: Final = 3
"""Number of worst frames of a class that are named."""
APART_NS: Final = 1_000_000_000
"""Least time between these frames."""


def count_classes(classes: Classes, truth: Truth, masks: Mapping[str, Mask]) -> dict[str, Sums]:
    """Count each class in each mask: ``(256, 3)`` by the mask's name, a row for each code.

    Columns are the pixels of the class; its pixels that are called road; and the missed road beside
    it. These are road pixels outside the mask: their nearest non-road pixel lies within `BESIDE`
    and has the class.
    """
    import cv2

    road, reach = truth == ROAD, math.hypot(*truth.shape) / BESIDE
    left, top, width, height = cv2.boundingRect(road.view(np.uint8))
    around = math.ceil(reach)
    near = np.s_[
        max(0, top - around) : top + height + around, max(0, left - around) : left + width + around
    ]
    is_other = truth[near] == NON_ROAD
    distances, numbers = cv2.distanceTransformWithLabels(
        (~is_other).view(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    class_of = np.full(numbers.max() + 1, NO_CLASS, np.uint8)
    class_of[numbers[is_other]] = classes[near][is_other]
    band = np.flatnonzero(road[near] & (distances <= reach))
    beside = class_of[numbers.ravel()[band]]
    pixels = np.bincount(classes.ravel(), minlength=256)
    return {
        name: np.stack(
            [
                pixels,
                np.bincount(classes[mask.view(np.bool_)], minlength=256),
                np.bincount(beside[mask[near].ravel()[band] == 0], minlength=256),
            ],
            axis=1,
        )
        for name, mask in masks.items()
    }


class ClassSums:
    """Sums of `count_classes` over a drive, and the frames with most errors on each class."""

    def __init__(self) -> None:
        self._sums = defaultdict[str, Sums](lambda: np.zeros((256, 4), np.int64))
        """The columns of `count_classes`, and the number of frames that have the class."""
        self._worst = defaultdict[tuple[str, int, bool], list[tuple[int, Moment]]](list)
        """Wrong pixels and their frame, most first, by variant, code, and if road is missed."""

    def add(self, moment: Moment, by_variant: Mapping[str, Sums]) -> None:
        """Add the counts of a frame."""
        for variant, counts in by_variant.items():
            self._sums[variant] += np.column_stack([counts, counts[:, 0] > 0])
            missed = counts[:, 0] - counts[:, 1]
            for is_missed, costs in ((False, counts[:, 1]), (True, missed)):
                for code in np.flatnonzero(costs[:NO_CLASS]).tolist():
                    worst, cost = self._worst[variant, code, is_missed], int(costs[code])
                    if len(worst) == SHOWN and cost <= worst[-1][0]:
                        continue
                    ranked = sorted([*worst, (cost, moment)], key=lambda frame: -frame[0])
                    stamps = np.array([at.stamp_ns for _, at in ranked])
                    places = separate(stamps, np.arange(len(ranked)), SHOWN, APART_NS)
                    worst[:] = [ranked[place] for place in places]

    def rows(self, classes: Sequence[TruthClass]) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of ``classes``; none if road and non-road have one class each.

        ``classes`` are in the order of codes. If they are too many for codes, they are objects.
        """
        for variant, sums in self._sums.items():
            seen = [(label, code) for code, label in enumerate(classes) if sums[code, 3]]
            kinds = Counter(label.truth for label, _ in seen if label.truth != "ignored")
            if max(kinds.values(), default=0) < 2 or len(classes) >= NO_CLASS:
                return
            for label, code in sorted(seen):
                worst = self._worst[variant, code, label.truth == "road"]
                numbers = [str(at.number) for _, at in worst if label.truth != "ignored"]
                yield variant, *label, *sums[code].tolist(), " ".join(numbers)
