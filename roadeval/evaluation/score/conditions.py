"""Conditions of frames: light, sharpness, movement, and the road's shape.

They are measured on the image and its truth, without masks. Slices of frames with more errors are
described by them (`roadeval.evaluation.stats.slices`).
"""

from __future__ import annotations

import math
import re
from array import array
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from roadeval.data import NO_CLASS, ROAD, FrameResult, Rgb, Truth, TruthClass
from roadeval.data.arrays import FN, FP, IGNORED, Plane
from roadeval.evaluation.stats.slices import OF_REGIONS, ON_CLASS

if TYPE_CHECKING:
    import pandas as pd

QUANTITIES: Final[Mapping[str, str]] = {
    "brightness": "mean luminance, from 0 to 1",
    "contrast": "standard deviation of the luminance, at a width of 64 pixels",
    "shadow": "detected shadow's share of the labelled pixels; empty without a filter",
    "blur": "1 minus the mean difference of neighbours in a row, relative to that of pixels four "
    "apart: 0 is sharp, 0.75 is smooth",
    "change": "mean difference of luminance from the frame before, at a width of 64 pixels; empty "
    "for the first",
    "road_share": "road's share of the labelled pixels of the truth",
    "curvature": "distance of the true road's middle from the straight line between its far and "
    "its near third, in the third between, relative to the image's width",
}
"""The measured quantities with their meanings."""
ACROSS: Final = 64
"""Width in pixels at which light and change are measured."""
LINES: Final = 32
"""Approximate number of rows of a frame from which blur and curvature are computed."""
LEAST_ROWS: Final = 6
"""Least number of rows with road for curvature."""
FAR: Final = 4
"""Distance of the farther pixels that blur compares."""
DIGITS: Final = 5
"""Decimal places of a value."""


def shrink(image: Rgb) -> Plane:
    """Return the luminance of an ``(H, W, 3)`` image, ``(h, 64)`` uint8."""
    import cv2

    height, width, _ = image.shape
    size = ACROSS, max(height * ACROSS // width, 1)
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY))


def blur(image: Rgb) -> float:
    """Return how blurred an ``(H, W, 3)`` image is, see `QUANTITIES`; NaN if it has one colour."""
    rows = image[:: max(len(image) // LINES, 1), :, 1].astype(np.int16)
    if rows.shape[1] <= FAR:
        return math.nan
    near, far = (float(np.abs(rows[:, k:] - rows[:, :-k]).mean()) for k in (1, FAR))
    return 1 - near / far if far else math.nan


def curvature(truth: Truth) -> float:
    """Return how bent the road of an ``(H, W)`` truth is, see `QUANTITIES`; NaN if in few rows."""
    road = truth[:: max(len(truth) // LINES, 1)] == ROAD
    sizes = road.sum(axis=1)
    there = sizes > 0
    if there.sum() < LEAST_ROWS:
        return math.nan
    middles = (road[there] @ np.arange(road.shape[1])) / sizes[there]
    far, between, near = (part.mean() for part in np.array_split(middles, 3))
    return float(abs(between - (far + near) / 2)) / road.shape[1]


def parts_of(result: FrameResult) -> Iterator[tuple[str, str | int, int, int]]:
    """Yield variant, part of the frame, and the numbers of wrong and of labelled pixels in it.

    Parts are bands of image rows, distances, the left and right half, and classes by code. For a
    class the number of pixels called road takes the place of the wrong ones.
    """
    for tally in {tally.variant: tally for tally in result.tallies}.values():
        for name, counts in tally.regions.items():
            if re.match(OF_REGIONS, name):
                yield tally.variant, name, counts.fp + counts.fn, counts.n
    for variant, errors in result.errors.items():
        halves = np.array_split(errors.array.astype(np.uint8, copy=False), 2, axis=1)
        for name, half in zip(("left", "right"), halves, strict=True):
            wrong, pixels = (half == FP) | (half == FN), half != IGNORED
            yield variant, name, int(np.count_nonzero(wrong)), int(np.count_nonzero(pixels))
    for variant, by_class in result.classes.items():
        for code in np.flatnonzero(by_class[:NO_CLASS, 0]).tolist():
            yield variant, code, int(by_class[code, 1]), int(by_class[code, 0])


class FrameConditions:
    """Collects the conditions of a drive's evaluated frames, and the counts of their parts."""

    def __init__(self) -> None:
        self._moments, self._values = array("q"), array("d")
        self._parts: dict[tuple[str, str | int], array[int]] = defaultdict(lambda: array("q"))
        self._before: Plane | None = None

    def add(self, result: FrameResult) -> None:
        """Add a frame, in the drive's order."""
        image, truth = result.frame.image, result.frame.truth
        before, now = self._before, shrink(image)
        self._before = now
        if not result.tallies or truth is None:
            return
        counts = result.tallies[-1].counts
        shade = next((t.regions["shadow"].n for t in result.tallies if "shadow" in t.regions), None)
        change = math.nan
        if before is not None and before.shape == now.shape:
            change = float(np.abs(now.astype(np.int16) - before).mean()) / 255
        values = {
            "brightness": float(now.mean()) / 255,
            "contrast": float(now.std()) / 255,
            "shadow": shade / counts.n if shade is not None and counts.n else math.nan,
            "blur": blur(image),
            "change": change,
            "road_share": (counts.tp + counts.fn) / counts.n if counts.n else math.nan,
            "curvature": curvature(truth),
        }
        self._moments.extend((result.frame.number, result.frame.stamp_ns))
        self._values.extend(round(values[name], DIGITS) for name in QUANTITIES)
        for variant, name, wrong, pixels in parts_of(result):
            self._parts[variant, name].extend((result.frame.number, wrong, pixels))

    def interrupt(self) -> None:
        """Note that the next frame does not follow the last one."""
        self._before = None

    @property
    def last(self) -> list[float]:
        """The values of the last evaluated frame, in the order of `QUANTITIES`."""
        return self._values[-len(QUANTITIES) :].tolist()

    def table(self) -> pd.DataFrame:
        """Return the rows of ``conditions``, without the key."""
        import pandas as pd

        moments = np.array(self._moments, np.int64).reshape(-1, 2)
        table = pd.DataFrame(moments, columns=["frame", "stamp_ns"])
        table[[*QUANTITIES]] = np.array(self._values).reshape(-1, len(QUANTITIES))
        return table

    def parts(self, classes: Sequence[TruthClass] = ()) -> pd.DataFrame:
        """Return a row for each frame, final mask and part: the wrong and the labelled pixels.

        ``classes`` are the truth's, in the order of codes; each is a part, ``on <name>``.
        """
        import pandas as pd

        columns = ["frame", "variant", "region", "wrong", "N"]
        tables = [pd.DataFrame(columns=columns)]
        for (variant, part), numbers in self._parts.items():
            name, truth = part, "other"
            if isinstance(part, int):
                value, name, truth = classes[part] if classes else (0, "", "ignored")
                name = f"{ON_CLASS}{name or f'class {value}'}"
            if truth != "ignored":
                frame, wrong, pixels = np.reshape(numbers, (-1, 3)).T
                wrong = pixels - wrong if truth == "road" else wrong
                values = (frame, variant, name, wrong, pixels)
                tables.append(pd.DataFrame(dict(zip(columns, values, strict=True))))
        return pd.concat(tables[1:] or tables)
