"""Whether truth, masks and images belong together: of the same frame, the same side and place.

Edges of a mask lie on edges of the image it was made of, and near those of the truth, whatever the
mask gets wrong. So the edges of the truth, and of each mask from elsewhere, are held against their
frame and its neighbours, as they are, mirrored, upside down and moved. What fits much better than
the plain pairing, in nearly all frames, is a finding. No number changes by it.
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
from roadeval.data.arrays import Floats, Places, Plane

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
_SMALLEST: Final = 96
"""Rows and columns of images, at least, that are looked at."""
_MARGIN: Final = _FAR + 2
"""Pixels at the image's border whose edges do not count: those of what was moved in from beyond."""
_POINTS: Final = 200
"""Points of a mask's edge that are looked at, about."""
_REACH: Final = 20
"""Pixels from another mask's edge up to which distances are told apart."""
_GROWN: Final = 8
"""Pixels that an edge may lie farther out or in all around: a method's way, and no finding."""
_HALF: Final = 2.5
"""Pixels from another mask's edge where nearness is one half."""
_NEAR: Final = 3.0
"""Pixels of a move that is named, at least: masks of many a method lie a little off."""
_CLEAR: Final = 0.7
"""Nearness to the truth of masks whose outline is clear: these tell a move from growth."""
_ALIKE: Final = 0.98
"""The share of it that moves by `_NEAR` more or less do not reach, then, where one is named."""
_LEAST: Final = 6
"""Spots without which nothing is found."""
_SURE: Final = 2.5
"""Least mean gain of what fits better over the spots, in standard errors."""
_MUCH: Final = 0.04
"""Least mean gain, as a share of how well the plain pairing fits."""
_STILL: Final = 0.005
"""The share of pixels whose truth changes from spot to spot, on average, up to which the scene is
one and the same: there a bad method's masks cannot be told from moved ones."""
_UPSIDE: Final = 0.4
"""The share of road high in the image is larger by so much than that before the vehicle, on
average, where road and other pixels are exchanged."""
_MOVES: Final = np.mgrid[-_FAR : _FAR + 1, -_FAR : _FAR + 1].reshape(2, -1, 1)
"""``(2, K, 1)``: pixels down and to the right."""
_STAY: Final = np.zeros((2, 1, 1), np.intp)
_GROWTHS: Final = np.arange(-_GROWN, _GROWN + 1)
_OFFSETS: Final = np.subtract.outer(np.arange(-_REACH, _REACH + 1), _GROWTHS)
_NEARNESS: Final = 1 / (1 + (_OFFSETS / _HALF) ** 2)
"""``(distances, growths)``: how near a point lies to an edge once its mask is grown so far."""


class Misfit(StrEnum):
    """How a subject does not fit."""

    LAG = "lag"
    MIRRORED = "mirrored"
    UPSIDE_DOWN = "upside down"
    INVERTED = "inverted"
    MOVED = "moved"


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


_Points = tuple[Places, Places]
"""``(n,)`` each: columns and rows."""


@dataclass(frozen=True, eq=False)
class _Mask:
    """The edge of a mask that is held against images and other masks."""

    x: Places
    y: Places
    right: Floats
    down: Floats
    """``(n,)`` each: points of the edge, and its normals, of length 1, which point inside."""
    distances: Plane
    """``(H, W)``: distance to the edge, `_REACH` at it, less inside, more outside."""

    def turned(self, way: int) -> _Mask:
        """Return it with left and right exchanged where ``way`` is 1, or upside down where 0."""
        x, y, right, down = self.x, self.y, self.right, self.down
        if way:
            x, right = self.distances.shape[1] - 1 - x, -right
        else:
            y, down = self.distances.shape[0] - 1 - y, -down
        return _Mask(x, y, right, down, np.ascontiguousarray(np.flip(self.distances, way)))


@dataclass(frozen=True, eq=False)
class _Slopes:
    """The slopes of a picture: ``(H, W)`` int16 each, and their mean size."""

    across: npt.NDArray[np.int16]
    down: npt.NDArray[np.int16]
    usual: float


@dataclass(frozen=True, eq=False)
class _View:
    """A frame at a spot or near one."""

    number: int
    image: _Slopes
    truth: _Points | None
    computed: _Points | None
    """Points of the edges of the truth, and of most masks that were computed here."""


@dataclass(frozen=True, eq=False)
class _Fit:
    """How well a subject fits a frame, at each of some moves."""

    image: Floats
    """``(K,)``: agreement with the image's edges."""
    other: Floats
    """``(K, growths)``: nearness to the truth's edges, or, for the truth, to those of the masks
    that were computed here; NaN without."""


def _slopes(picture: Plane) -> _Slopes:
    import cv2

    across, down = cv2.spatialGradient(cv2.GaussianBlur(picture, (5, 5), 1.2))
    usual = (cv2.norm(across, cv2.NORM_L1) + cv2.norm(down, cv2.NORM_L1)) / picture.size
    return _Slopes(across, down, usual)


def _edge(road: Plane, ignored: Plane | None) -> Plane:
    """Return the edge of an ``(H, W)`` mask, nonzero there, away from what is ignored."""
    import cv2

    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    edge = cv2.morphologyEx(road, cv2.MORPH_GRADIENT, cross)
    if ignored is not None:
        edge[cv2.dilate(ignored, np.ones((7, 7), np.uint8)) > 0] = 0
    return np.asarray(edge, np.uint8)


def _points(edge: Plane) -> _Points:
    """Return some points of an edge, away from the border."""
    import cv2

    inner = cv2.findNonZero(edge[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN])
    if inner is None:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    some = inner.reshape(-1, 2)[:: max(1, len(inner) // _POINTS)]
    x, y = some.T.astype(np.intp) + _MARGIN
    return x, y


def _mask(road: Plane, ignored: Plane | None) -> _Mask:
    """Return the edge of an ``(H, W)`` mask of 0 and 255, away from what is ignored."""
    import cv2

    edge, slopes = _edge(road, ignored), _slopes(road)
    x, y = _points(edge)
    across, down = (s[y, x].astype(np.float32) for s in (slopes.across, slopes.down))
    size = np.maximum(np.hypot(across, down), 1e-9)
    away = cv2.distanceTransform((edge == 0).astype(np.uint8), cv2.DIST_L2, 3)
    away = np.asarray(np.minimum(away, _REACH) + 0.5, np.uint8)
    distances = np.where(road > 0, _REACH - away, _REACH + away)
    return _Mask(x, y, across / size, down / size, distances)


def _fit(mask: _Mask, image: _Slopes, other: _Points | None, moves: npt.NDArray[np.intp]) -> _Fit:
    """Return how well a mask fits an image and another mask's edge once moved back.

    ``moves`` are ``(2, K, 1)``, or ``(2, K, n)`` where each point moves in a way of its own.
    """
    steps = moves[0] * mask.distances.shape[1] + moves[1]
    place = mask.y * mask.distances.shape[1] + mask.x - steps
    across, down = (s.ravel()[place].astype(np.float32) for s in (image.across, image.down))
    # The cosine of twice the angle between normal and slope: 1 along it, -1 across.
    size = across**2 + down**2
    along = 2 * (mask.right * across + mask.down * down) ** 2 - size
    agreement = along / np.maximum(size + image.usual * np.sqrt(size), 1e-9)
    agreement = agreement.sum(axis=1, dtype=np.float64) / max(len(mask.x), 1)
    if other is None:
        return _Fit(agreement, np.full((len(place), len(_GROWTHS)), np.nan))
    x, y = other
    distances = mask.distances.ravel()[y * mask.distances.shape[1] + x + steps]
    shape = len(place), len(_NEARNESS)
    codes = distances + np.arange(shape[0])[:, None] * shape[1]
    counts = np.bincount(codes.ravel(), minlength=shape[0] * shape[1]).reshape(shape)
    return _Fit(agreement, counts @ _NEARNESS / max(len(x), 1))


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
        self._recent: deque[_View] = deque(maxlen=LAST_LAG)
        self._open: list[tuple[int, dict[str, _Mask]]] = []
        """Frame and masks of the spots whose later neighbours are still to come."""
        self._fits = defaultdict[Finding, dict[int, _Fit]](dict)
        """By change and frame of a spot; a lag of 0 is no change."""
        self._moves = defaultdict[str, list[tuple[_Fit, Floats]]](list)
        """By subject, for each spot: the fit at each of `_MOVES`, and, where it stays, the
        agreement with the image at each of `_GROWTHS`."""
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
        self._open = [spot for spot in self._open if frame.number - spot[0] <= reach]
        is_near = self._due - frame.number <= reach
        if not (is_spot or self._open or is_near):
            return
        view = _view(frame, computed)
        for number, masks in self._open:
            self._note_lag(number, masks, view)
        if is_spot:
            self._due = frame.number + self._apart
            masks = self._new_spot(frame, view)
            for earlier in self._recent:
                self._note_lag(frame.number, masks, earlier)
            self._open.append((frame.number, masks))
        self._recent.append(view)

    def _new_spot(self, frame: Frame, view: _View) -> dict[str, _Mask]:
        """Note how a spot's subjects fit its own frame; return them."""
        shrunk = _shrinking(frame.image.shape)
        subjects = {name: mask * np.uint8(255) for name, mask in frame.external.items()}
        if frame.truth is not None:
            subjects[TRUTH] = _road(frame.truth)
            if self._truth is not None and frame.truth.shape == self._truth.shape:
                self._changes.append(float(np.mean(subjects[TRUTH] != self._truth)))
            self._truth = subjects[TRUTH]
        masks = {}
        for name, full in subjects.items():
            if full.shape != frame.image.shape[:2]:
                continue
            road, ignored = shrunk(full), None
            if name == TRUTH and frame.truth is not None:
                ignored = shrunk((frame.truth == IGNORE).astype(np.uint8))
            self._upside[name].append(_share_above(road, ignored))
            mask = masks[name] = _mask(road, ignored)
            self._note(frame.number, Finding(name, Misfit.LAG), mask, view)
            self._note(frame.number, Finding(name, Misfit.MIRRORED), mask.turned(1), view)
            self._note(frame.number, Finding(name, Misfit.UPSIDE_DOWN), mask.turned(0), view)
            if name != TRUTH and view.truth is not None:
                fit = _fit(mask, view.image, view.truth, _MOVES)
                normals = np.array([mask.down, mask.right])[:, None]
                outward = np.rint(_GROWTHS[:, None] * normals).astype(np.intp)
                self._moves[name].append((fit, _fit(mask, view.image, None, outward).image))
        return masks

    def _note_lag(self, spot: int, masks: dict[str, _Mask], view: _View) -> None:
        """Note how a spot's subjects fit a frame before or after it."""
        steps, rest = divmod(spot - view.number, self._stride)
        if not rest and 0 < abs(steps) <= LAST_LAG:
            for name, mask in masks.items():
                self._note(spot, Finding(name, Misfit.LAG, frames=steps), mask, view)

    def _note(self, spot: int, change: Finding, mask: _Mask, view: _View) -> None:
        other = view.computed if change.subject == TRUTH else view.truth
        self._fits[change][spot] = _fit(mask, view.image, other, _STAY)

    def findings(self) -> Iterator[Finding]:
        """Yield what does not fit, the truth first."""
        truth = self._finding(TRUTH, alone=False)
        if truth is not None:
            yield truth
        for name in self._upside:
            if name != TRUTH and (finding := self._finding(name, alone=truth is not None)):
                yield finding

    def _finding(self, name: str, *, alone: bool) -> Finding | None:
        """Return what is sure about a subject, by the images ``alone`` or by the truth as well."""
        plain = Finding(name, Misfit.LAG)
        if len(self._fits[plain]) < _LEAST:
            return None
        changes = [change for change in self._fits if change.subject == name and change != plain]
        # Masks that were computed here may have learnt that the truth is mirrored, but not
        # that it is late.
        gains = {
            change: _gain(
                self._fits[plain],
                self._fits[change],
                images_only=alone or (name == TRUTH and change.misfit is not Misfit.LAG),
            )
            for change in changes
        }
        if len(self._moves[name]) >= _LEAST and not alone and np.mean(self._changes) > _STILL:
            gains |= dict([_best_move(name, self._moves[name])])
        change = max(gains, key=lambda change: gains[change].mean, default=plain)
        is_off = change.misfit is not Misfit.MOVED or math.hypot(change.right, change.down) >= _NEAR
        if is_off and gains[change].errors > _SURE and gains[change].share > _MUCH:
            return replace(
                change,
                frames=change.frames * self._stride,
                right=change.right * _times(self._shape),
                down=change.down * _times(self._shape),
            )
        if np.nanmean(self._upside[name]) > _UPSIDE:
            return Finding(name, Misfit.INVERTED)
        return None


@dataclass(frozen=True)
class _Gain:
    """How much better something fits on average: plainly, in standard errors, and as a share."""

    mean: float
    errors: float
    share: float

    @classmethod
    def of(cls, before: Floats, after: Floats) -> _Gain:
        """Return the gain from fits of each spot, ``(spots,)``, to those after a change."""
        gain = after - before
        mean = float(gain.mean())
        error = max(float(gain.std(ddof=1)) / math.sqrt(len(gain)), 1e-9)
        return cls(mean, mean / error, mean / max(float(before.mean()), 0.02))


def _gain(plain: dict[int, _Fit], changed: dict[int, _Fit], *, images_only: bool) -> _Gain:
    """Return how much better a change fits than the plain pairing; 0 where few spots tell."""
    spots = [spot for spot in changed if spot in plain]
    if len(spots) < _LEAST:
        return _Gain(0, 0, 0)
    before, after = (np.array([fits[spot].image[0] for spot in spots]) for fits in (plain, changed))
    if not images_only:
        near = np.array([[fits[spot].other[0] for spot in spots] for fits in (plain, changed)])
        near[:, np.isnan(near).any(axis=(0, 2))] = 0
        # How far a method's edges lie out or in is its way, before and after the change.
        before, after = (
            agreement + nearness[:, nearness.mean(axis=0).argmax()]
            for agreement, nearness in zip((before, after), near, strict=True)
        )
    return _Gain.of(before, after)


def _best_move(name: str, spots: Sequence[tuple[_Fit, Floats]]) -> tuple[Finding, _Gain]:
    """Return the move that fits best, and its gain over edges that lie out or in all around.

    Of so many moves one always fits better by chance. So the gain at every other spot is that of
    the move that fits best at the rest.
    """
    agreement = np.array([fit.image for fit, _ in spots])
    nearness = np.array([fit.other for fit, _ in spots])

    def best(among: npt.NDArray[np.bool_]) -> tuple[int, int]:
        near = nearness[among].mean(axis=0)
        move = int((agreement[among].mean(axis=0) + near.max(axis=1)).argmax())
        return move, int(near[move].argmax())

    still = np.array([grown for _, grown in spots]) + nearness[:, len(_MOVES[0]) // 2]
    after = np.zeros(len(spots))
    for judged in (np.arange(len(spots)) % 2 == part for part in (0, 1)):
        move, growth = best(~judged)
        after[judged] = (agreement[:, move] + nearness[:, move, growth])[judged]
    gain = _Gain.of(still[:, still.mean(axis=0).argmax()], after)
    place = best(np.ones(len(spots), bool))[0]
    down, right = _MOVES[:, place, 0].tolist()
    # The slanted sides of a road that is grown lie as if it were moved up. Where another move and
    # growth fit a clear outline as well, or perhaps moves farther off, nothing is sure.
    near = nearness.mean(axis=0).max(axis=1)
    others = near[np.hypot(_MOVES[0] - down, _MOVES[1] - right)[:, 0] >= _NEAR]
    is_alike = others.max() > _ALIKE * near[place] or max(abs(right), abs(down)) == _FAR
    if near.max() > _CLEAR and is_alike:
        gain = replace(gain, errors=0.0)
    return Finding(name, Misfit.MOVED, right=right, down=down), gain


def _road(truth: Plane) -> Plane:
    return (truth == ROAD).astype(np.uint8) * np.uint8(255)


def _view(frame: Frame, computed: Sequence[Packed]) -> _View:
    import cv2

    shrunk = _shrinking(frame.image.shape)
    image = _slopes(shrunk(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY)))
    truth = most = None
    if frame.truth is not None and frame.external:
        ignored = shrunk((frame.truth == IGNORE).astype(np.uint8))
        truth = _points(_edge(shrunk(_road(frame.truth)), ignored))
    masks = [mask.pixels() for mask in computed if mask.shape == frame.image.shape[:2]]
    if masks and frame.truth is not None:
        share = shrunk(sum(masks, np.zeros_like(masks[0])) * np.uint8(255 // len(masks)))
        most = _points(_edge((share > 127).astype(np.uint8), None))
    return _View(frame.number, image, truth, most)


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
