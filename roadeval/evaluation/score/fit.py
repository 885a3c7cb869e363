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
_FAR: Final = 13
"""Pixels that a mask may have been moved by."""
_WIDEST: Final = 640
"""Columns of the images that are looked at: larger ones are reduced."""
_MARGIN: Final = _FAR + 2
"""Pixels at the image's border whose edges do not count: those of what was moved in from beyond."""
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
_SURE: Final = 3.0
"""Least mean gain of what fits better over the spots, in standard errors."""
_RATHER: Final = 1.5
"""The same of a move over an edge that lies farther out, or in, all around."""
_MUCH: Final = 0.05
"""Least mean gain, as a share of how well the plain pairing fits."""
_STILL: Final = 0.005
"""The share of pixels whose truth changes from spot to spot, on average, up to which the scene is
one and the same: there a bad method's masks cannot be told from moved ones."""
_SMALLEST: Final = 96
"""Rows and columns of images, at least, that are looked at."""
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
    """A subject that does not fit the images, and the change by which it would."""

    subject: str
    """`TRUTH`, or the name of the variant whose masks they are."""
    misfit: Misfit
    frames: int = 0
    """Frames by which the subject is late; below 0 it is early. 0 unless it lags."""
    right: int = 0
    down: int = 0
    """Pixels by which the subject is moved to the right and down. 0 unless it is moved."""


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

    across, down = cv2.spatialGradient(cv2.GaussianBlur(picture, (5, 5), 1.2))
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
    inner = np.flatnonzero(edge[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN])
    inner = inner[:: max(1, len(inner) // _POINTS)]
    y, x = (place + _MARGIN for place in np.divmod(inner, road.shape[1] - 2 * _MARGIN))
    across, down = (s[y, x].astype(np.float32) for s in (slopes.across, slopes.down))
    size = np.maximum(np.hypot(across, down), 1e-9)
    right, below = across / size, down / size
    return _Edges(x, y, right**2 - below**2, 2 * right * below, (right, below))


def _agreement(
    edges: _Edges, slopes: _Slopes, right: npt.NDArray[np.intp], below: npt.NDArray[np.intp]
) -> Floats:
    """Return how well edges lie on slopes once moved back by some steps, ``(K,)``, at most 1."""
    width = slopes.across.shape[1]
    place = edges.y * width + edges.x - (below * width + right)[:, None]
    across, down = (s.ravel()[place].astype(np.float32) for s in (slopes.across, slopes.down))
    size = np.hypot(across, down)
    along = edges.cosine * (across**2 - down**2) + edges.sine * 2 * across * down
    fit = along / np.maximum(size * (size + slopes.usual), 1e-9)
    return np.asarray(fit.sum(1) / max(len(edges.x), 1), np.float64)


def _times(shape: tuple[int, ...]) -> int:
    """Return how many columns of an image become one."""
    return -(-shape[1] // _WIDEST)


def _shrinking(shape: tuple[int, ...]) -> Callable[[Plane], Plane]:
    """Return what reduces a plane of a wide image to at most `_WIDEST` columns."""
    import cv2

    times = _times(shape)
    if times == 1:
        return lambda plane: plane
    size = shape[1] // times, shape[0] // times
    return lambda plane: np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), np.uint8)


@dataclass(frozen=True, eq=False)
class _Seen:
    """The slopes of a frame that is near a spot."""

    number: int
    image: _Slopes
    truth: _Slopes | None
    computed: _Slopes | None
    """Slopes of the mean of the masks that were computed from the image here."""


_PLAIN: Final = (Misfit.LAG, 0, 0, 0)
Hypothesis = tuple[Misfit, int, int, int]
"""A misfit with frames, pixels to the right and pixels down, as in `Finding`."""
_NONE: Final = np.zeros(1, np.intp)
_MOVES: Final = np.mgrid[-_FAR : _FAR + 1, -_FAR : _FAR + 1].reshape(2, -1)


class FitCheck:
    """Collects, frame by frame in the drive's order, how well truth and masks fit.

    So many ``spots`` among the ``numbers``, of which each ``stride``-th is read, are looked at,
    and their neighbours. Time and memory do not grow with the drive.
    """

    def __init__(self, numbers: Sequence[int], stride: int = 1, spots: int = SPOTS) -> None:
        self._due = float(numbers[0])
        self._apart = (numbers[-1] - numbers[0]) / spots
        self._stride = stride
        self._shape: tuple[int, ...] = ()
        """Shape of the first image; images of another size are not looked at."""
        self._recent: deque[_Seen] = deque(maxlen=LAST_LAG)
        self._open: list[tuple[int, int, dict[str, _Edges]]] = []
        self._spots = 0
        self._fits = defaultdict[str, dict[Hypothesis, dict[int, tuple[float, float]]]](dict)
        """By subject, hypothesis and spot: agreement with the image, and with the truth."""
        self._moved = defaultdict[str, dict[int, Floats]](dict)
        """By subject and spot: the same of each of `_MOVES`, ``(2, K)``."""
        self._upside = defaultdict[str, list[float]](list)
        self._truth: Plane | None = None
        """Truth of the last spot, 255 for road."""
        self._changes: list[float] = []

    def add(self, frame: Frame, computed: Sequence[Packed] = ()) -> None:
        """Look at the next frame; ``computed`` are the masks that were made of it here."""
        self._shape = self._shape or frame.image.shape
        if frame.image.shape != self._shape or min(self._shape[:2]) < _SMALLEST:
            return
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
        road = subjects.get(TRUTH)
        if road is not None and self._truth is not None and road.shape == self._truth.shape:
            self._changes.append(float(np.mean(road != self._truth)))
        self._truth = self._truth if road is None else road
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
                self._moved[name][self._spots] = np.array(moved)
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
        if len(fits.get(_PLAIN, ())) < _LEAST:
            return None
        moved = self._moved[name]
        if len(moved) >= _LEAST and not alone and np.mean(self._changes) > _STILL:
            place = int(sum(moved.values(), np.zeros((2, 1))).sum(0).argmax())
            down, right = _MOVES[:, place].tolist()
            fits[Misfit.MOVED, 0, right, down] = {n: (*v[:, place],) for n, v in moved.items()}
        gains: dict[Hypothesis, _Gain] = {}
        for each in fits:
            # Masks that were computed here may have learnt that the truth is mirrored, but not
            # that it is late.
            images_only = alone or (name == TRUTH and each[0] is not Misfit.LAG)
            if each != _PLAIN:
                gain = self._gain(name, each, images_only=images_only)
                gains |= {each: gain} if gain else {}
        key = max(
            (each for each in gains if each[0] is not Misfit.GROWN),
            key=lambda each: gains[each].mean,
            default=_PLAIN,
        )
        misfit, frames, right, down = key
        is_sure = key != _PLAIN and gains[key].errors > _SURE and gains[key].share > _MUCH
        if misfit is Misfit.MOVED:
            # A move must fit better than an edge that lies farther out, or in, all around.
            ways = [each for each in gains if each[0] is Misfit.GROWN]
            way = max(ways, key=lambda each: gains[each].mean, default=_PLAIN)
            better = self._gain(name, key, way)
            is_near = math.hypot(right, down) <= _NEAR
            is_sure = is_sure and not is_near and better is not None and better.errors > _RATHER
        if is_sure:
            times = _times(self._shape)
            return Finding(name, misfit, frames * self._stride, right * times, down * times)
        if np.nanmean(self._upside[name]) > _UPSIDE:
            return Finding(name, Misfit.INVERTED)
        return None

    def _gain(
        self,
        name: str,
        key: Hypothesis,
        base: Hypothesis = _PLAIN,
        *,
        images_only: bool = False,
    ) -> _Gain | None:
        """Return how much better a hypothesis fits than another; None where few spots tell."""
        values, before = self._fits[name][key], self._fits[name][base]
        spots = [spot for spot in values if spot in before]
        if len(spots) < _LEAST:
            return None
        columns = slice(0, 1 if images_only else 2)
        ours, theirs = (np.array([v[spot] for spot in spots])[:, columns] for v in (values, before))
        gain = np.nansum(ours - theirs, axis=1)
        error = max(float(gain.std(ddof=1)) / math.sqrt(len(gain)), 1e-9)
        fit = max(float(np.nansum(theirs + 0 * ours, axis=1).mean()), 0.02)
        return _Gain(mean := float(gain.mean()), mean / error, mean / fit)


@dataclass(frozen=True)
class _Gain:
    """How much better something fits on average: plainly, in standard errors, and as a share."""

    mean: float
    errors: float
    share: float


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
