"""Whether truth, masks and images belong together: of the same frame, the same side and place.

Edges of a mask lie on edges of the image it was made of, whatever the mask gets wrong. So the edges
of the truth, and of each mask from elsewhere, are held against the image of their frame and of its
neighbours, as they are, mirrored, upside down and moved; masks against the truth as well. What fits
much better than the plain pairing, in nearly all frames, is a finding. No number changes by it.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, ROAD, Frame, Packed
from roadeval.data.arrays import Floats, Plane

TRUTH: Final = "truth"
"""The subject that is no mask of a method."""
SPOTS: Final = 20
"""Frames of a drive that are looked at, spread evenly."""
LAST_LAG: Final = 5
"""Frames before and after each of them."""
_FAR: Final = 14
"""Pixels that a mask may have been moved by."""
_WIDEST: Final = 640
"""Columns of the images that are looked at: larger ones are reduced."""
_GROWN: Final = 8
"""Pixels that its edge may lie farther out or in all around."""
_NEAR: Final = 2.5
"""Pixels of a move that is named, at least: masks of many a method lie a little off."""
_FEWER: Final = 3
"""Every so many points of the edge are held against the moves."""
_POINTS: Final = 400
"""Points of a mask's edge that are looked at."""
_LEAST: Final = 6
"""Spots without which nothing is found."""
_SURE: Final = 4.0
"""Least mean gain of what fits better over the spots, in standard errors."""
_MUCH: Final = 1.08
"""How many times as well as the plain pairing it fits, at least."""
_UPSIDE: Final = 0.4
"""The share of road high in the image is larger by so much than that before the vehicle, on
average, where road and other pixels are exchanged."""


class Misfit(StrEnum):
    """How a subject does not fit."""

    LAG = "lag"
    MIRRORED = "mirrored"
    UPSIDE_DOWN = "upside down"
    INVERTED = "inverted"
    MOVED = "moved"
    GROWN = "grown"
    """Its edge lies farther out, or in, all around: the method's own way, and no finding."""


@dataclass(frozen=True)
class Finding:
    """What does not fit, and how it would."""

    subject: str
    """`TRUTH`, or the name of the variant whose masks they are."""
    misfit: Misfit
    frames: int = 0
    """Of a lag: how many frames late the subject is; below 0 early."""
    right: int = 0
    down: int = 0
    """Of what is moved: by how many pixels."""


@dataclass(frozen=True, eq=False)
class _Edges:
    """Points of a mask's edge."""

    x: npt.NDArray[np.intp]
    y: npt.NDArray[np.intp]
    cosine: Floats
    sine: Floats
    """``(n,)`` each: of twice the angle of the edge's normal."""
    inward: tuple[Floats, Floats]
    """``(n,)`` each: the normal itself, right and down, of length 1; it points into the mask."""

    def every(self, step: int) -> _Edges:
        """Return every so many of the points."""
        right, down = self.inward
        return _Edges(
            *(self.x[::step], self.y[::step]),
            *(self.cosine[::step], self.sine[::step]),
            (right[::step], down[::step]),
        )


@dataclass(frozen=True, eq=False)
class _Slopes:
    """The slopes of a picture: ``(H, W)`` int16 each, and their mean size."""

    across: npt.NDArray[np.int16]
    down: npt.NDArray[np.int16]
    usual: float


def _slopes(picture: Plane) -> _Slopes:
    import cv2

    smooth = cv2.GaussianBlur(picture, (5, 5), 1.2)
    across, down = (cv2.Sobel(smooth, cv2.CV_16S, *way) for way in ((1, 0), (0, 1)))
    usual = (cv2.norm(across, cv2.NORM_L1) + cv2.norm(down, cv2.NORM_L1)) / picture.size
    return _Slopes(across, down, usual)


def _edges(road: Plane, ignored: Plane | None) -> _Edges:
    """Return points of the edge of an ``(H, W)`` mask of 0 and 255, away from what is ignored."""
    import cv2

    slopes = _slopes(road)
    cross = np.ones((3, 3), np.uint8)
    edge = cv2.morphologyEx(road, cv2.MORPH_GRADIENT, cross)
    if ignored is not None:
        edge[cv2.dilate(ignored, np.ones((7, 7), np.uint8)) > 0] = 0
    margin = 4
    inner = np.flatnonzero(edge[margin:-margin, margin:-margin])
    inner = inner[:: max(1, len(inner) // _POINTS)]
    y, x = (place + margin for place in np.divmod(inner, road.shape[1] - 2 * margin))
    across, down = (np.asarray(s[y, x], float) for s in (slopes.across, slopes.down))
    size = np.maximum(np.hypot(across, down), 1e-9)
    right, below = across / size, down / size
    return _Edges(x, y, right**2 - below**2, 2 * right * below, (right, below))


def _agreement(
    edges: _Edges, slopes: _Slopes, right: npt.NDArray[np.intp], below: npt.NDArray[np.intp]
) -> Floats:
    """Return how well edges lie on slopes once moved back by some steps, ``(K,)``, at most 1."""
    height, width = slopes.across.shape
    x, y = edges.x - right[:, None], edges.y - below[:, None]
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    place = np.where(inside, y * width + x, 0)
    across, down = (s.ravel()[place].astype(np.float32) for s in (slopes.across, slopes.down))
    size = np.hypot(across, down)
    along = edges.cosine * (across**2 - down**2) + edges.sine * 2 * across * down
    fit = inside * along / np.maximum(size * (size + slopes.usual), 1e-9)
    return np.asarray(fit.sum(1) / max(len(edges.x), 1), np.float64)


def _shrinking(shape: tuple[int, ...]) -> Callable[[Plane], Plane]:
    """Return what reduces a plane of a wide image to at most `_WIDEST` columns."""
    import cv2

    times = -(-shape[1] // _WIDEST)
    if times == 1:
        return lambda plane: plane
    size = shape[1] // times, shape[0] // times
    return lambda plane: np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), np.uint8)


@dataclass(frozen=True, eq=False)
class _Seen:
    """What is kept of a frame that is near a spot."""

    number: int
    image: _Slopes
    truth: _Slopes | None
    computed: _Slopes | None
    """Of the mean of the masks that were computed from the image here."""


_PLAIN: Final = (Misfit.LAG, 0, 0, 0)
Hypothesis = tuple[Misfit, int, int, int]
"""A misfit with frames, pixels to the right and pixels down, as in `Finding`."""
_NONE: Final = np.zeros(1, np.intp)
_MOVES: Final = np.mgrid[-_FAR : _FAR + 1, -_FAR : _FAR + 1].reshape(2, -1)


class FitCheck:
    """Collects, frame by frame in the drive's order, how well truth and masks fit.

    About `SPOTS` frames among the ``numbers``, of which each ``stride``-th is read, are looked at,
    and their neighbours. Time and memory do not grow with the drive.
    """

    def __init__(self, numbers: Sequence[int], stride: int = 1) -> None:
        self._due = float(numbers[0])
        self._apart = (numbers[-1] - numbers[0]) / SPOTS
        self._stride = stride
        self._recent: deque[_Seen] = deque(maxlen=LAST_LAG)
        self._open: list[tuple[int, int, dict[str, _Edges]]] = []
        self._spots = 0
        self._fits = defaultdict[str, dict[Hypothesis, dict[int, tuple[float, float]]]](dict)
        """By subject, hypothesis and spot: agreement with the image, and with the truth."""
        self._upside = defaultdict[str, list[float]](list)

    def add(self, frame: Frame, computed: Sequence[Packed] = ()) -> None:
        """Look at the next frame; ``computed`` are the masks that were made of it here."""
        is_spot = frame.number >= self._due and (frame.truth is not None or frame.external)
        reach = LAST_LAG * self._stride
        self._open = [spot for spot in self._open if frame.number - spot[1] <= reach]
        is_near = self._due - frame.number <= reach
        if not (is_spot or self._open or is_near):
            return
        seen = _look_at(frame, computed)
        for place, number, edges in self._open:
            self._hold(place, frame.number - number, edges, seen)
        if is_spot:
            self._due = frame.number + self._apart
            edges = self._new_spot(frame, seen)
            for earlier in self._recent:
                self._hold(self._spots, earlier.number - frame.number, edges, earlier)
            self._open.append((self._spots, frame.number, edges))
            self._spots += 1
        self._recent.append(seen)

    def _new_spot(self, frame: Frame, seen: _Seen) -> dict[str, _Edges]:
        """Note what a spot's subjects fit without a neighbour; return their edges."""
        shrunk = _shrinking(frame.image.shape)
        subjects = {name: mask * np.uint8(255) for name, mask in frame.external.items()}
        ignored = None
        if frame.truth is not None:
            ignored = shrunk((frame.truth == IGNORE).astype(np.uint8))
            subjects[TRUTH] = (frame.truth == ROAD).astype(np.uint8) * np.uint8(255)
        edges = {}
        for name, mask in subjects.items():
            if mask.shape != frame.image.shape[:2]:
                continue
            road = shrunk(mask)
            self._upside[name].append(_share_above(road, ignored if name == TRUTH else None))
            own = edges[name] = _edges(road, ignored if name == TRUTH else None)
            height, width = road.shape
            mirrored = replace(own, x=width - 1 - own.x, sine=-own.sine)
            flipped = replace(own, y=height - 1 - own.y, sine=-own.sine)
            self._note(name, _PLAIN, own, seen)
            self._note(name, (Misfit.MIRRORED, 0, 0, 0), mirrored, seen)
            self._note(name, (Misfit.UPSIDE_DOWN, 0, 0, 0), flipped, seen)
            if name != TRUTH and seen.truth is not None:
                down, right = _MOVES
                few = own.every(_FEWER)
                moved = [_agreement(few, s, right, down) for s in (seen.image, seen.truth)]
                for place, both in enumerate(zip(*moved, strict=True)):
                    key = (Misfit.MOVED, 0, int(right[place]), int(down[place]))
                    self._fits[name].setdefault(key, {})[self._spots] = both
                for pixels in filter(None, range(-_GROWN, _GROWN + 1)):
                    x, y = (
                        place - np.rint(pixels * way).astype(np.intp)
                        for place, way in zip((own.x, own.y), own.inward, strict=True)
                    )
                    key = (Misfit.GROWN, 0, pixels, 0)
                    self._note(name, key, replace(own, x=x, y=y), seen)
        return edges

    def _hold(self, place: int, later: int, edges: dict[str, _Edges], seen: _Seen) -> None:
        """Hold a spot's subjects against a frame that is ``later`` by so many numbers."""
        steps, rest = divmod(later, self._stride)
        if not rest and 0 < abs(steps) <= LAST_LAG:
            for name, own in edges.items():
                self._note(name, (Misfit.LAG, -steps, 0, 0), own, seen, place)

    def _note(
        self, name: str, key: Hypothesis, edges: _Edges, seen: _Seen, place: int | None = None
    ) -> None:
        image, other = (
            math.nan if slopes is None else float(_agreement(edges, slopes, _NONE, _NONE)[0])
            for slopes in (seen.image, seen.computed if name == TRUTH else seen.truth)
        )
        spot = self._spots if place is None else place
        self._fits[name].setdefault(key, {})[spot] = image, other

    def findings(self) -> Iterator[Finding]:
        """Yield what does not fit, the truth first."""
        truth = self._finding(TRUTH, alone=False)
        if truth is not None:
            yield truth
        for name in self._fits:
            if name != TRUTH and (found := self._finding(name, alone=truth is not None)):
                yield found

    def _finding(self, name: str, *, alone: bool) -> Finding | None:
        """Return what is sure about a subject, by the images ``alone`` or by the truth as well."""
        fits = self._fits.get(name, {})
        plain = fits.get(_PLAIN, {})
        if len(plain) < _LEAST:
            return None
        # A move must fit better than an edge that lies farther out, or in, all around.
        own_ways = [v for key, v in fits.items() if key == _PLAIN or key[0] is Misfit.GROWN]
        ways = max(own_ways, key=lambda v: float(np.nansum([*v.values()])))
        best: tuple[float, Hypothesis, Floats, Floats] | None = None
        for key, values in fits.items():
            if key == _PLAIN or key[0] is Misfit.GROWN or (alone and key[0] is Misfit.MOVED):
                continue
            before = ways if key[0] is Misfit.MOVED else plain
            spots = [spot for spot in values if spot in before]
            # What was computed here may have learnt that the truth is mirrored, not that it is
            # late.
            images_only = alone or (name == TRUTH and key[0] is not Misfit.LAG)
            columns = slice(0, 1 if images_only else 2)
            own, base = (
                np.array([v[spot] for spot in spots])[:, columns] for v in (values, before)
            )
            gains = np.nansum(own - base, axis=1)
            if len(spots) >= _LEAST and (best is None or gains.mean() > best[0]):
                best = float(gains.mean()), key, gains, np.nansum(base + 0 * own, axis=1)
        if best is not None:
            mean, (misfit, frames, right, down), gains, base = best
            error = float(gains.std(ddof=1)) / math.sqrt(len(gains))
            far = misfit is not Misfit.MOVED or math.hypot(right, down) > _NEAR
            if far and mean > _SURE * error and mean > (_MUCH - 1) * max(base.mean(), 0.02):
                return Finding(name, misfit, frames * self._stride, right, down)
        if np.nanmean(self._upside[name]) > _UPSIDE:
            return Finding(name, Misfit.INVERTED)
        return None


def _look_at(frame: Frame, computed: Sequence[Packed]) -> _Seen:
    import cv2

    shrunk = _shrinking(frame.image.shape)
    image = _slopes(shrunk(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY)))
    truth = None
    if frame.truth is not None and frame.external:
        truth = _slopes(shrunk((frame.truth == ROAD).astype(np.uint8) * np.uint8(255)))
    mean = None
    masks = [mask.pixels() for mask in computed if mask.shape == frame.image.shape[:2]]
    if masks and frame.truth is not None:
        mean = _slopes(shrunk(sum(masks, np.zeros_like(masks[0])) * np.uint8(255 // len(masks))))
    return _Seen(frame.number, image, truth, mean)


def _share_above(road: Plane, ignored: Plane | None) -> float:
    """Return the share of road in the upper quarter less that before the vehicle; -1 to 1."""
    height, width = road.shape
    counted = np.ones_like(road) if ignored is None else ignored == 0
    upper = slice(0, height // 4), slice(None)
    before = slice(-height // 4, None), slice(width // 3, -(width // 3))
    if not (counted[upper].any() and counted[before].any()):
        return math.nan
    above, below = (float((road[part] > 0)[counted[part] > 0].mean()) for part in (upper, before))
    return above - below
