"""Labels that annotation tools draw: outlines and runs of pixels, each with the name of a class.

One rule turns outlines of all tools into pixels: a pixel belongs to an outline if its centre lies
inside, by the even-odd rule; the corner of the image is at 0,0 and the centre of its first pixel at
0.5,0.5. If shapes overlap, the later one covers the earlier one, and an ignored class covers all
others.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import dropwhile
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.images.formats import Limits, Size
from roadeval.logs.errors import BadMessage
from roadeval.logs.files import first_names
from roadeval.runtime.sentence import Sentence

Mask = npt.NDArray[np.bool_]
_CORNERS: Final = 90
"""Points of an ellipse."""


@dataclass(frozen=True)
class ClassRoles:
    """The meaning of the classes of drawn labels, by the settings."""

    road: Set[str]
    ignored: Set[str]
    skip_roadless: bool


class Outline(NamedTuple):
    """An area inside a ring of points."""

    label: str
    ring: Sequence[float]
    """``x, y, x, y, ...`` in pixels."""

    def fill(self, size: Size) -> Mask:
        """Return the ``(H, W)`` pixels of the area; a `BadMessage` if it is not an outline."""
        points = self.points()
        filled = np.zeros(size[::-1], np.bool_)
        # The part of the image around it: from the first pixel to before the last.
        left, top = np.clip(np.ceil(points.min(axis=0)), 0, size).astype(int).tolist()
        right, bottom = np.clip(np.floor(points.max(axis=0)) + 1, 0, size).astype(int).tolist()
        crossings = np.zeros((bottom - top, right - left + 1), np.bool_)
        for side in zip(points.tolist(), np.roll(points, -1, axis=0).tolist(), strict=True):
            # Two outlines with a common side must compute it in the same direction.
            (x, y), (next_x, next_y) = sorted(side, key=itemgetter(1))
            first, end = np.ceil(np.clip((y, next_y), top, bottom)).astype(int)
            if first < end:
                rows = np.arange(first, end)
                at = x + (rows - y) * (next_x - x) / (next_y - y)
                columns = np.ceil(np.clip(at, left, right)).astype(int)
                crossings[rows - top, columns - left] ^= True
        inside = np.logical_xor.accumulate(crossings, axis=1)
        filled[top:bottom, left:right] = inside[:, : right - left]
        return filled

    def points(self) -> npt.NDArray[np.float64]:
        """Return the ``(n, 2)`` points of the ring, relative to the centre of the first pixel."""
        try:
            ring = np.asarray(self.ring, np.float64)
        except (TypeError, ValueError, OverflowError):
            ring = np.array(np.nan)
        if ring.ndim != 1 or not ring.size or len(ring) % 2 or not (np.abs(ring) <= 1e6).all():
            raise BadMessage(f"an outline of {self.label} whose points are not pixels")
        return ring.reshape(-1, 2) - 0.5

    def rotate(self, degrees: float, about: tuple[float, float]) -> Outline:
        """Return the outline rotated clockwise, as seen in the image, about a point in pixels."""
        cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        points = np.reshape(self.ring, (-1, 2)) - about
        rotated = points @ np.array([[cosine, sine], [-sine, cosine]]) + about
        return self._replace(ring=rotated.ravel().tolist()) if degrees else self


def rectangle(label: str, left: float, top: float, right: float, bottom: float) -> Outline:
    """Return the outline of a rectangle, given two opposite corners in pixels."""
    return Outline(label, (left, top, right, top, right, bottom, left, bottom))


def ellipse(label: str, x: float, y: float, across: float, down: float) -> Outline:
    """Return the outline of an ellipse, given its centre and its two radii in pixels."""
    angles = np.linspace(0, 2 * np.pi, _CORNERS, endpoint=False)
    # A polygon outside the curve has the same area as the curve.
    wider = math.sqrt(2 * np.pi / _CORNERS / math.sin(2 * np.pi / _CORNERS))
    points = (x + wider * across * np.cos(angles), y + wider * down * np.sin(angles))
    return Outline(label, np.stack(points, 1).ravel().tolist())


def hull(label: str, ring: Sequence[float]) -> Outline:
    """Return the convex outline around points, such as the corners of a cuboid in the image."""
    import cv2

    points = np.reshape(np.asarray(ring, np.float32), (-1, 2))
    return Outline(label, cv2.convexHull(points).ravel().tolist())


def flatten(points: Iterable[Iterable[float]]) -> list[float]:
    """Return ``x, y, x, y, ...`` of points."""
    return [float(number) for x, y in points for number in (x, y)]


def size_in(stated: Mapping[str, Any], width: str = "width", height: str = "height") -> Size | None:
    """Return the size that a table states under two names; None if it states none."""
    with suppress(KeyError, TypeError, ValueError, OverflowError):
        return int(stated[width]), int(stated[height])
    return None


class Runs(NamedTuple):
    """An area of runs of pixels, alternately outside and inside, in a box of the image."""

    label: str
    lengths: Sequence[int]
    box: tuple[int, int, int, int] | None = None
    """Left, top, width and height; the whole image by default."""
    by_columns: bool = False
    """Whether the runs go down the columns instead of along the rows."""

    def fill(self, size: Size) -> Mask:
        """Return the ``(H, W)`` pixels of the area; a `BadMessage` if the runs do not fit."""
        left, top, width, height = self.box or (0, 0, *size)
        try:
            lengths = np.asarray(self.lengths, np.int64)
        except (TypeError, ValueError, OverflowError):
            lengths = np.array([-1])
        fits = left + width <= size[0] and top + height <= size[1]
        fits = fits and min(left, top, width, height, lengths.min(initial=0)) >= 0
        # Too great lengths could overflow to the right sum.
        fits = fits and lengths.max(initial=0) <= width * height
        if not fits or lengths.sum() != width * height:
            raise BadMessage(f"a mask of {self.label} that does not fit its image")
        inside = np.repeat(np.arange(len(lengths)) % 2 == 1, lengths)
        filled = np.zeros(size[::-1], np.bool_)
        filled[top : top + height, left : left + width] = (
            inside.reshape(width, height).T if self.by_columns else inside.reshape(height, width)
        )
        return filled


class Undrawn(NamedTuple):
    """A shape with unknown pixels.

    If its class is ignored, its box is ignored in place of it. If its class is road, or it is
    ignored and has no box, its image is lost. A shape of another class is left out with a note.
    """

    label: str
    what: str
    """Its kind, in words that follow "a" or a number."""
    box: Outline | None = None
    """The box around it, if known."""

    def fill(self, size: Size) -> Mask:
        """Return the ``(H, W)`` pixels of its box, or none."""
        return np.zeros(size[::-1], np.bool_) if self.box is None else self.box.fill(size)

    def is_replaced(self, roles: ClassRoles) -> bool:
        """Return whether its box stands for it."""
        return self.box is not None and self.label in roles.ignored


Shape = Outline | Runs | Undrawn


@dataclass(frozen=True)
class DrawnLabel:
    """The shapes on one image."""

    image: str
    """The name of the image's file, or a text that ends with the number of its frame."""
    size: Size | None
    """Size of the image; None if the format does not state it."""
    shapes: Iterable[Shape]
    """Its shapes, perhaps an iterator: an error while it runs loses this image only."""

    def complete(self, size: Size | None) -> DrawnLabel:
        """Return the label with all its shapes, and with this size if it has none.

        Raises the errors of the format, and a `BadMessage` if a shape has no class.
        """
        shapes = tuple(self.shapes)
        if any(not shape.label or not isinstance(shape.label, str) for shape in shapes):
            raise BadMessage("a shape without the name of a class")
        return replace(self, size=self.size or size, shapes=shapes)

    @property
    def classes(self) -> set[str]:
        """The classes that occur."""
        return {shape.label for shape in self.shapes}

    def content(self) -> bytes:
        """Return the bytes that determine its pixels."""
        return json.dumps([self.size, [*self.shapes]]).encode()

    def pixels(self, values: Mapping[str, int], limits: Limits) -> npt.NDArray[np.uint16]:
        """Return the ``(H, W)`` values of the classes, 0 where no shape is.

        A `BadMessage` if a shape does not fit the image, or the size of the image is unknown.
        """
        if self.size is None:
            raise BadMessage("neither the label nor the log says how large the image is")
        limits.check(*self.size)
        pixels = np.zeros(self.size[::-1], np.uint16)
        for shape in self.shapes:
            pixels[shape.fill(self.size)] = values[shape.label]
        return pixels


class Proposal(NamedTuple):
    """A mask for an annotator to correct."""

    image: str
    """The name of the image's file."""
    road: Mask
    """``(H, W)``."""
    ignored: Mask | None = None
    """``(H, W)``, if pixels may be ignored."""

    @property
    def size(self) -> Size:
        """Width and height in pixels."""
        height, width = self.road.shape
        return width, height

    @property
    def levels(self) -> npt.NDArray[np.uint8]:
        """``(H, W)``: 255 where there is road, 128 where pixels are ignored, else 0."""
        levels = np.uint8(255) * self.road
        return levels if self.ignored is None else np.where(self.ignored, np.uint8(128), levels)

    def runs(self, *, by_columns: bool = False) -> list[int]:
        """Return the lengths of its runs, alternately outside and inside, the first outside."""
        pixels = self.road.T.ravel() if by_columns else self.road.ravel()
        changes = np.flatnonzero(np.diff(pixels, prepend=False))
        lengths: list[int] = np.diff(changes, prepend=0, append=pixels.size).tolist()
        return lengths


def runs_of(label: str, pixels: Mask, left: int = 0, top: int = 0) -> Runs:
    """Return the area of a mask with its first pixel at this place in the image."""
    area = Proposal("", pixels)
    return Runs(label, area.runs(), (left, top, *area.size))


@dataclass(frozen=True)
class LabelFormat:
    """A format of files with labels.

    `roadeval.logs.truth.label_files` parses a file by its ending: ``.json`` to lists and dicts,
    ``.xml`` to its root element, ``.txt`` to a text.
    """

    name: str
    ending: str
    """The ending of its files, in lower case."""
    holds: Callable[[Path, Any], bool]
    """Return whether a parsed file is of this format. If several formats with the same ending
    match, the first reads it, in the order of their modules' names."""
    read: Callable[[Path, Any, Size | None], Iterable[DrawnLabel]]
    """Return the label of each image in a parsed file of this format, given the size of the log's
    images. A `LogError` or `BadMessage` describes a label that cannot be used; a KeyError,
    TypeError or ValueError means that the file, or the image, breaks the rules of the format."""


def has_keys(*keys: str) -> Callable[[Path, Any], bool]:
    """Return a function that tells whether the content of a file is a table with these keys."""
    return lambda _, content: isinstance(content, dict) and {*keys} <= content.keys()


def settle_shapes(
    drawings: Sequence[DrawnLabel], roles: ClassRoles, broken: dict[str, str], notes: list[str]
) -> list[DrawnLabel]:
    """Return the images with the shapes that count, ignored ones on top.

    Images that are lost are added to the ``broken`` ones, with the reason, and warnings, a sentence
    each, to the ``notes``.
    """
    usable: list[DrawnLabel] = []
    for drawing in drawings:
        filled, unknown = list[Shape](), list[Undrawn]()
        for shape in drawing.shapes:
            if isinstance(shape, Undrawn) and not shape.is_replaced(roles):
                unknown.append(shape)
            else:
                filled.append(shape)
        if lost := [shape for shape in unknown if shape.label in roles.road | roles.ignored]:
            broken[drawing.image] = f"{lost[0].label} is drawn as a {lost[0].what}"
            continue
        filled.sort(key=lambda shape: shape.label in roles.ignored)
        usable.append(replace(drawing, shapes=tuple(filled)))
    shapes = [shape for drawing in drawings for shape in drawing.shapes]
    for what, is_ignored in (
        ("not drawn: where they lie on the road, it counts as road", False),
        ("ignored as the boxes around them, for they have no outline", True),
    ):
        kinds = Counter(
            f"{shape.label} ({shape.what})"
            for shape in shapes
            if isinstance(shape, Undrawn) and shape.label not in roles.road
            if (shape.label in roles.ignored) is is_ignored
        )
        if kinds:
            listing = ", ".join(f"{count} of {kind}" for kind, count in kinds.most_common())
            notes.append(f"{kinds.total()} of {len(shapes)} shapes are {what}: {listing}")
    without = [drawing.image for drawing in usable if roles.road.isdisjoint(drawing.classes)]
    if without and roles.road:
        counted = "left out" if roles.skip_roadless else "counted as images without road"
        advice = Sentence("{truth.skip_roadless} leaves them out")
        roadless = (
            f"{len(without)} of {len(drawings)} images have shapes, but none of road, and are "
            f"{counted} ({first_names(without)})"
        )
        notes.append(roadless if roles.skip_roadless else Sentence("{}; {}", roadless, advice))
        # If no image has road, the class of road is named wrongly, which is reported later.
        if roles.skip_roadless and len(without) < len(usable):
            usable = [d for d in usable if not roles.road.isdisjoint(d.classes)]
    notes += _find_hidden_shapes(usable, roles)
    return usable


def _find_hidden_shapes(drawings: Sequence[DrawnLabel], roles: ClassRoles) -> Iterator[str]:
    """Yield a warning if road covers earlier shapes of other classes, which then count as road."""
    crossed = []
    for drawing in drawings:
        labels = [shape.label for shape in drawing.shapes if shape.label not in roles.ignored]
        if not roles.road.isdisjoint(dropwhile(roles.road.__contains__, labels)):
            crossed.append(drawing)
    area = max((math.prod(drawing.size or (1, 1)) for drawing in crossed), default=1)
    # Twenty images are looked at, or more if they have few pixels, spread over all.
    sample = crossed[:: -(-len(crossed) // max(20, 20_000_000 // max(area, 1))) or 1]
    shares, classes = list[float](), Counter[str]()
    for drawing in sample:
        names = ["", *drawing.classes]
        values = {name: value for value, name in enumerate(names)}
        road = [values[name] for name in names if name in roles.road]
        below = sorted(drawing.shapes, key=lambda shape: shape.label not in roles.road)
        with suppress(BadMessage, ValueError, TypeError, OverflowError):
            top = drawing.pixels(values, Limits())
            under = replace(drawing, shapes=below).pixels(values, Limits())
            is_road = np.isin(top, road)
            hidden = under[is_road & ~np.isin(under, road)]
            if len(hidden) > 0.005 * np.count_nonzero(is_road):  # less is outlines that touch
                shares.append(len(hidden) / np.count_nonzero(is_road))
                classes.update(names[value] for value in np.unique(hidden).tolist())
    if shares:
        images = f"{len(drawings)} images"
        if len(sample) < len(crossed):
            images = f"{len(sample)} images that were looked at"
        yield Sentence(
            "road was drawn over {} in {} of {}: {} % of the road's pixels there, which count "
            "as road; draw road first, or name these classes in {labels.ignore}",
            ", ".join(name for name, _ in classes.most_common()),
            len(shares),
            images,
            f"{100 * np.mean(shares):.1f}",
        )
