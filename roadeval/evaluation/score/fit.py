"""Whether truth, masks and images belong together: to the same frame, side and place.

Edges of a mask lie on edges of its image, and near edges of the truth, whatever the mask gets
wrong. So the edges of the truth, and of masks from other systems, are compared with their frame and
its neighbours: plainly, mirrored, upside down and moved. A change that fits much better than the
plain pairing, in nearly all frames, is a finding. Findings change no number.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, ROAD, Frame, Packed
from roadeval.data.arrays import Floats, Places, Plane

TRUTH: Final = "truth"
"""The name of the truth among the subjects; others are methods' masks."""
SPOTS: Final = 20
"""Number of frames of a drive that are examined, spread evenly."""
LAST_LAG: Final = 5
"""Number of frames before and after each of them that are examined too."""
_FAR: Final = 15
"""Greatest move of a mask in pixels."""
_WIDEST: Final = 640
"""Greatest width of examined images in pixels; larger ones are reduced."""
_SMALLEST: Final = 96
"""Least height and width of examined images in pixels."""
_MARGIN: Final = _FAR + 2
"""Pixels at the image's border that are left out, because a move may bring outside pixels there."""
_POINTS: Final = 200
"""Approximate number of points of a mask's edge that are examined."""
_REACH: Final = 20
"""Greatest distance from another mask's edge that is measured, in pixels."""
_NEAR: Final = 3.0
"""Least move that is reported, in pixels: the masks of many methods lie a little off."""
_CLEAR: Final = 0.7
"""Nearness to the truth above which a mask's outline is clear enough to tell a move from growth."""
_IMAGE: Final = 1.5
"""Weight of the image's edges relative to the truth's in the search for a move."""
_LEAST: Final = 6
"""Number of spots that a finding needs."""
_SURE: Final = 2.5
"""Least mean gain in fit over the spots, in standard errors."""
_MUCH: Final = 0.04
"""Least mean gain, as a share of how well the plain pairing fits."""
_STILL: Final = 0.005
"""Mean share of pixels that change in the truth between spots, up to which a scene stands still: a
bad method's masks then look like moved ones."""
_UPSIDE: Final = 0.4
"""Least excess of the share of road high in the image over the share before the vehicle, if road
and the rest are exchanged."""
_SQUARE: Final = np.mgrid[-_FAR : _FAR + 1, -_FAR : _FAR + 1].reshape(2, -1, 1)
_MOVES: Final = _SQUARE[:, np.hypot(*_SQUARE[:, :, 0]) <= _FAR]
"""``(2, K, 1)``: pixels down and to the right."""
_STAY: Final = np.zeros((2, 1, 1), np.intp)
_GROWTHS: Final = np.arange(-8, 9)
"""Pixels by which a whole edge may lie farther out or in without a finding: methods differ so."""
_NEARNESS: Final = 1 / (1 + ((np.arange(-_REACH, _REACH + 1)[:, None] - _GROWTHS) / 2.5) ** 2)
"""``(distances, growths)``: how near a point lies to an edge after growth of its mask."""


class Misfit(StrEnum):
    """The way in which a subject does not fit."""

    LAG = "lag"
    MIRRORED = "mirrored"
    UPSIDE_DOWN = "upside down"
    INVERTED = "inverted"
    MOVED = "moved"


@dataclass(frozen=True)
class Finding:
    """A subject that does not fit the images, and the change after which it does."""

    subject: str
    """`TRUTH`, or the name of the variant of the masks."""
    misfit: Misfit
    frames: int = 0
    """Frames by which the subject is late; below 0 it is early. 0 unless it lags."""
    right: int = 0
    down: int = 0
    """Pixels by which the subject is moved to the right and down. 0 unless it is moved."""


_Points = tuple[Places, Places]
"""``(n,)`` each: columns and rows."""
_Slopes = npt.NDArray[np.complex64]
"""``(H, W)`` or ``(n,)``: to the right as the real part, down as the imaginary one."""


@dataclass(frozen=True, eq=False)
class _Mask:
    """The edge of a mask that is compared with images and other masks."""

    x: Places
    y: Places
    normals: _Slopes
    """``(n,)`` each: the points of the edge, and unit normals there that point inside."""
    distances: Plane
    """``(H, W)``: signed distance to the edge plus `_REACH`; it is less inside the mask."""

    @classmethod
    def of(cls, road: Plane, ignored: Plane) -> _Mask:
        """Return the edge of an ``(H, W)`` mask of 0 and 255, without parts near ignored pixels."""
        import cv2

        edge = _edge(road, ignored)
        x, y = _points(edge)
        normals = _slopes(road)[y, x]
        away = cv2.distanceTransform((edge == 0).astype(np.uint8), cv2.DIST_L2, 3)
        away = np.asarray(np.minimum(away, _REACH) + 0.5, np.uint8)
        distances = np.where(road > 0, _REACH - away, _REACH + away)
        normals /= np.maximum(abs(normals), np.float32(1e-9))
        return cls(x, y, normals, distances)

    def turn(self, way: int) -> _Mask:
        """Return the mask mirrored if ``way`` is 1, or upside down if it is 0."""
        last = self.distances.shape[way] - 1
        x, y = (last - self.x, self.y) if way else (self.x, last - self.y)
        normals = -self.normals.conj() if way else self.normals.conj()
        return _Mask(x, y, normals, np.ascontiguousarray(np.flip(self.distances, way)))


@dataclass(frozen=True, eq=False)
class _View:
    """A frame at a spot or near one."""

    number: int
    image: _Slopes
    truth: _Points | None
    computed: _Points | None
    """Points of the edges of the truth, and of most masks that were computed here."""


def _slopes(picture: Plane) -> _Slopes:
    """Return the gradients of a picture, ``(H, W)``, divided by their mean size."""
    import cv2

    ways = cv2.spatialGradient(cv2.GaussianBlur(picture, (5, 5), 1.2))
    scale = np.float32(picture.size / max(sum(cv2.norm(way, cv2.NORM_L1) for way in ways), 1))
    return np.asarray(cv2.merge([way * scale for way in ways])).view(np.complex64)[..., 0]


def _edge(road: Plane, ignored: Plane) -> Plane:
    """Return the edge of an ``(H, W)`` mask as nonzero, without parts near ignored pixels."""
    import cv2

    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    edge = cv2.morphologyEx(road, cv2.MORPH_GRADIENT, cross)
    edge[cv2.dilate(ignored, np.ones((7, 7), np.uint8)) > 0] = 0
    return np.asarray(edge, np.uint8)


def _points(edge: Plane) -> _Points:
    """Return about `_POINTS` points of an edge, away from the border."""
    inner = edge[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN]
    places = np.flatnonzero(inner != 0)
    y, x = np.divmod(places[:: max(1, len(places) // _POINTS)], inner.shape[1])
    return x + _MARGIN, y + _MARGIN


def _fit(mask: _Mask, image: _Slopes, other: _Points | None, moves: npt.NDArray[np.intp]) -> Floats:
    """Return how well a mask fits an image and another mask's edge after it is moved back.

    ``moves`` are ``(2, K, 1)``, or ``(2, K, n)`` if each point has its own move. The result is
    ``(K, 1 + growths)``: the agreement with the image's edges, -1 to 1, and the nearness to the
    other edge at each of `_GROWTHS`, 0 to 1, or NaN if there is none.
    """
    steps = moves[0] * mask.distances.shape[1] + moves[1]
    place = mask.y * mask.distances.shape[1] + mask.x - steps
    # The cosine of twice the angle between normal and slope: 1 along it, -1 across.
    slopes = image.ravel()[place]
    size = abs(slopes)
    along = (slopes * mask.normals.conj()) ** 2
    agreement = (along.real / np.maximum(size * (size + 1), 1e-9)).sum(axis=1, dtype=np.float64)
    fits = np.full((len(place), 1 + len(_GROWTHS)), np.nan)
    fits[:, 0] = agreement / max(len(mask.x), 1)
    if other is None:
        return fits
    x, y = other
    distances = mask.distances.ravel()[y * mask.distances.shape[1] + x + steps]
    codes = distances + np.arange(len(place))[:, None] * len(_NEARNESS)
    counts = np.bincount(codes.ravel(), minlength=len(place) * len(_NEARNESS))
    fits[:, 1:] = counts.reshape(len(place), -1) @ _NEARNESS / max(len(x), 1)
    return fits


class FitCheck:
    """Collects, frame by frame in the drive's order, how well truth and masks fit.

    ``numbers`` are the frames' numbers, and every ``stride``-th frame is read. About ``spots``
    frames and their neighbours are examined. Time and memory do not grow with the drive.
    """

    def __init__(self, numbers: Sequence[int], stride: int = 1, spots: int = SPOTS) -> None:
        self._due = float(numbers[0])
        self._apart = (numbers[-1] - numbers[0]) / spots
        self._stride = stride
        self._shape: tuple[int, ...] = ()
        """Shape of the first image; images of another size are left out."""
        self._times = 1
        """Number of its columns, and of its rows, that are averaged into one."""
        self._recent: deque[_View] = deque(maxlen=LAST_LAG)
        self._open: list[tuple[int, dict[str, _Mask]]] = []
        """Frame number and masks of each spot that waits for later neighbours."""
        self._fits = defaultdict[Finding, dict[int, Floats]](dict)
        """Fits by change and by frame of a spot; a lag of 0 is not a change."""
        self._moves = defaultdict[str, list[tuple[Floats, Floats]]](list)
        """The fit at each of `_MOVES`, and without a move the agreement with the image at each of
        `_GROWTHS`, for each spot by subject."""
        self._upside = defaultdict[str, list[float]](list)
        """The share of road in the upper quarter minus the share before the vehicle, -1 to 1, for
        each spot by subject."""
        self._roads: list[Plane] = []
        """Road of the truth at each spot."""

    def add(self, frame: Frame, computed: Sequence[Packed] = ()) -> None:
        """Examine the next frame; ``computed`` are the masks that this program made of it."""
        self._shape = self._shape or frame.image.shape
        self._times = -(-self._shape[1] // _WIDEST)
        if frame.image.shape != self._shape or min(self._shape[:2]) < _SMALLEST:
            return
        is_spot = frame.number >= self._due and (frame.truth is not None or frame.external)
        reach = LAST_LAG * self._stride
        self._open = [spot for spot in self._open if frame.number - spot[0] <= reach]
        if not (is_spot or self._open or self._due - frame.number <= reach):
            return
        view = self._view(frame, computed)
        for number, masks in self._open:
            self._note(number, masks, view, Misfit.LAG)
        if is_spot:
            self._due = frame.number + self._apart
            masks = self._new_spot(frame, view)
            for near in (*self._recent, view):
                self._note(frame.number, masks, near, Misfit.LAG)
            self._open.append((frame.number, masks))
        self._recent.append(view)

    def _shrunk(self, plane: Plane) -> Plane:
        import cv2

        size = plane.shape[1] // self._times, plane.shape[0] // self._times
        return np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), np.uint8)

    def _road(self, truth: Plane) -> tuple[Plane, Plane]:
        """Return the road of a truth as 255, and its ignored pixels as nonzero."""
        road, ignored = ((truth == code) * np.uint8(255) for code in (ROAD, IGNORE))
        return self._shrunk(road), self._shrunk(ignored)

    def _view(self, frame: Frame, computed: Sequence[Packed]) -> _View:
        import cv2

        image = _slopes(self._shrunk(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY)))
        truth = most = None
        if frame.truth is not None and frame.external:
            truth = _points(_edge(*self._road(frame.truth)))
        masks = [mask.pixels() for mask in computed if mask.shape == self._shape[:2]]
        if masks and frame.truth is not None:
            votes = self._shrunk(sum(masks, np.zeros_like(masks[0])) * np.uint8(255 // len(masks)))
            most = _points(_edge((votes > 127).astype(np.uint8), np.zeros_like(votes)))
        return _View(frame.number, image, truth, most)

    def _new_spot(self, frame: Frame, view: _View) -> dict[str, _Mask]:
        """Note how a spot's subjects, turned and moved, fit its frame; return them."""
        subjects = {}
        for name, mask in frame.external.items():
            if mask.shape == self._shape[:2]:
                road = self._shrunk(mask * np.uint8(255))
                subjects[name] = road, np.zeros_like(road)
        if frame.truth is not None and frame.truth.shape == self._shape[:2]:
            subjects[TRUTH] = self._road(frame.truth)
            self._roads.append(subjects[TRUTH][0])
        masks = {}
        for name, (road, ignored) in subjects.items():
            height, width = road.shape
            upper = slice(0, height // 4), slice(None)
            before = slice(-height // 4, None), slice(width // 3, -(width // 3))
            above, below = (road[part][ignored[part] == 0] > 0 for part in (upper, before))
            excess = above.mean() - below.mean() if above.size and below.size else math.nan
            self._upside[name].append(float(excess))
            edge = masks[name] = _Mask.of(road, ignored)
            if name != TRUTH and view.truth is not None:
                normals = np.array([edge.normals.imag, edge.normals.real])[:, None]
                outward = np.rint(_GROWTHS[:, None] * normals).astype(np.intp)
                grown = _fit(edge, view.image, None, outward)[:, 0]
                self._moves[name].append((_fit(edge, view.image, view.truth, _MOVES), grown))
        for way, misfit in enumerate((Misfit.UPSIDE_DOWN, Misfit.MIRRORED)):
            turned = {name: edge.turn(way) for name, edge in masks.items()}
            self._note(frame.number, turned, view, misfit)
        return masks

    def _note(self, spot: int, masks: dict[str, _Mask], view: _View, misfit: Misfit) -> None:
        """Note how a spot's subjects fit its frame, or a frame before or after it."""
        steps, rest = divmod(spot - view.number, self._stride)
        if not rest and abs(steps) <= LAST_LAG:
            for name, mask in masks.items():
                other = view.computed if name == TRUTH else view.truth
                change = Finding(name, misfit, steps)
                self._fits[change][spot] = _fit(mask, view.image, other, _STAY)

    def findings(self) -> Iterator[Finding]:
        """Yield the findings, the truth's first."""
        truth = self._finding(TRUTH, alone=False)
        names = (name for name in self._upside if name != TRUTH)
        masks = (self._finding(name, alone=truth is not None) for name in names)
        yield from (finding for finding in (truth, *masks) if finding is not None)

    def _finding(self, name: str, *, alone: bool) -> Finding | None:
        """Return the sure finding on a subject, from images ``alone`` or from the truth as well."""
        plain = self._fits[Finding(name, Misfit.LAG)]
        if len(plain) < _LEAST:
            return None
        gains = {}
        for change, fits in self._fits.items():
            # Masks computed here may have learnt from mirrored truth, but not from late truth.
            images_only = alone or (name == TRUTH and change.misfit is not Misfit.LAG)
            if change.subject == name and fits is not plain:
                gains[change] = _gain(plain, fits, images_only=images_only)
        changes = [np.mean(road != after) for road, after in pairwise(self._roads)]
        if len(self._moves[name]) >= _LEAST and not alone and np.mean(changes) > _STILL:
            gains |= dict([_best_move(name, self._moves[name])])
        change = max(gains, key=lambda change: gains[change].mean)
        is_off = change.misfit is not Misfit.MOVED or math.hypot(change.right, change.down) >= _NEAR
        if is_off and gains[change].errors > _SURE and gains[change].share > _MUCH:
            frames, times = change.frames * self._stride, self._times
            right, down = change.right * times, change.down * times
            return replace(change, frames=frames, right=right, down=down)
        if np.nanmean(self._upside[name]) > _UPSIDE:
            return Finding(name, Misfit.INVERTED)
        return None


class _Gain(NamedTuple):
    """The mean gain in fit: plainly, in standard errors, and as a share."""

    mean: float = 0.0
    errors: float = 0.0
    share: float = 0.0

    @classmethod
    def of(cls, before: Floats, after: Floats) -> _Gain:
        """Return the gain from the fits of the spots, ``(spots,)``, to the fits after a change."""
        gain = after - before
        mean = float(gain.mean())
        error = max(float(gain.std(ddof=1)) / math.sqrt(len(gain)), 1e-9)
        return cls(mean, mean / error, mean / max(float(before.mean()), 0.02))


def _gain(plain: dict[int, Floats], changed: dict[int, Floats], *, images_only: bool) -> _Gain:
    """Return how much better a change fits than the plain pairing; 0 if spots are too few."""
    spots = [spot for spot in changed if spot in plain]
    if len(spots) < _LEAST:
        return _Gain()
    fits = np.array([[change[spot][0] for spot in spots] for change in (plain, changed)])
    fits[:, images_only | np.isnan(fits).any(axis=(0, 2)), 1:] = 0
    # A method's edges may lie out or in by any distance, before and after the change.
    return _Gain.of(*(fit[:, 0] + fit[:, 1 + fit[:, 1:].mean(axis=0).argmax()] for fit in fits))


def _best_move(name: str, spots: Sequence[tuple[Floats, Floats]]) -> tuple[Finding, _Gain]:
    """Return the move that fits best, and its gain over edges that lie out or in as a whole.

    Among many moves one always fits better by chance. So the gain at each spot is computed for the
    move that fits best at the other spots.
    """
    fits, grown = (np.array(values) for values in zip(*spots, strict=True))

    def best(mean: Floats) -> tuple[int, list[int]]:
        # Masks made of the image's edges lie exactly on these, but a little off the truth; learnt
        # masks do the opposite. The fit that stands out more over the moves decides.
        clear = np.array([mean[:, 0], mean[:, 1:].max(axis=1)])
        clear = np.maximum(clear - np.median(clear, axis=1, keepdims=True), 0) ** 2
        move = int((_IMAGE * clear[0] + clear[1]).argmax())
        return move, [0, 1 + int(mean[move, 1:].argmax())]

    still = grown + fits[:, _MOVES.shape[1] // 2, 1:]
    rest = (fits.sum(axis=0) - fits) / (len(fits) - 1)
    after = np.array([fit[best(mean)].sum() for fit, mean in zip(fits, rest, strict=True)])
    gain = _Gain.of(still[:, still.mean(axis=0).argmax()], after)
    move = best(fits.mean(axis=0))[0]
    down, right = _MOVES[:, move, 0].tolist()
    # The slanted sides of a road that has grown lie as if it were moved up. If moves farther away
    # bring a clear outline as near to the truth, nothing is sure.
    near = fits[:, :, 1:].mean(axis=0).max(axis=1)
    apart = np.hypot(_MOVES[0] - down, _MOVES[1] - right)[:, 0] >= _NEAR
    is_alike = near[apart].max() > (1 - _MUCH) * near[move] or math.hypot(right, down) > _FAR - 2
    if near.max() > _CLEAR and is_alike:
        gain = _Gain()
    return Finding(name, Misfit.MOVED, right=right, down=down), gain
