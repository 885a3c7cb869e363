"""Labels that annotation tools draw: outlines and runs of pixels, each with the name of a class.

One rule turns an outline into pixels, whichever tool wrote it: a pixel belongs to it if the pixel's
centre lies inside, by the even-odd rule; the corner of the image is at 0,0 and the centre of its
first pixel at 0.5,0.5. Where shapes overlap, the later one covers the earlier one.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.images import Limits
from roadeval.logs.errors import BadMessage

Mask = npt.NDArray[np.bool_]
Size = tuple[int, int]
"""Width and height in pixels."""
FARTHEST: Final = 1e6
"""Pixels from the image's corner at which a point may lie."""


class Outline(NamedTuple):
    """An area inside a ring of points."""

    label: str
    ring: Sequence[float]
    """``x, y, x, y, ...`` in pixels."""

    def fill(self, size: Size) -> Mask:
        """Return the ``(H, W)`` pixels that belong to it; a `BadMessage` if it is no outline."""
        width, height = size
        crossings = np.zeros((height, width + 1), np.bool_)
        points = self.points()
        for side in zip(points.tolist(), np.roll(points, -1, axis=0).tolist(), strict=True):
            # In one direction, whichever of two outlines the side belongs to.
            (x, y), (next_x, next_y) = sorted(side, key=itemgetter(1))
            first, end = np.ceil(np.clip((y, next_y), 0, height)).astype(int)
            if first < end:
                rows = np.arange(first, end)
                at = x + (rows - y) * (next_x - x) / (next_y - y)
                crossings[rows, np.ceil(np.clip(at, 0, width)).astype(int)] ^= True
        filled: Mask = np.logical_xor.accumulate(crossings, axis=1)[:, :width]
        return filled

    def points(self) -> npt.NDArray[np.float64]:
        """Return the ``(n, 2)`` points of the ring, from the centre of the first pixel."""
        flat = np.asarray(self.ring, np.float64)
        if flat.ndim != 1 or len(flat) % 2 or not (np.abs(flat) <= FARTHEST).all():
            raise BadMessage(f"an outline of {self.label} whose points are no pixels")
        return flat.reshape(-1, 2) - 0.5


def rectangle(label: str, left: float, top: float, right: float, bottom: float) -> Outline:
    """Return the outline of a rectangle, given two opposite corners in pixels."""
    return Outline(label, (left, top, right, top, right, bottom, left, bottom))


class Runs(NamedTuple):
    """An area of runs of pixels, alternately outside and inside of it, in a box of the image."""

    label: str
    lengths: Sequence[int]
    box: tuple[int, int, int, int] | None = None
    """Left, top, width and height; the whole image by default."""
    by_columns: bool = False
    """Whether the runs go down the columns instead of along the rows."""

    def fill(self, size: Size) -> Mask:
        """Return the ``(H, W)`` pixels that belong to it; a `BadMessage` if the runs do not fit."""
        left, top, width, height = self.box or (0, 0, *size)
        lengths = np.asarray(self.lengths, np.int64)
        fits = left + width <= size[0] and top + height <= size[1]
        fits = fits and min(left, top, width, height, lengths.min(initial=0)) >= 0
        # Lengths that are too great could add up to the same number by overflow.
        fits = fits and lengths.max(initial=0) <= width * height
        if not fits or lengths.sum() != width * height:
            raise BadMessage(f"a mask of {self.label} that does not fit its image")
        inside = np.repeat(np.arange(len(lengths)) % 2 == 1, lengths)
        filled = np.zeros(size[::-1], np.bool_)
        filled[top : top + height, left : left + width] = (
            inside.reshape(width, height).T if self.by_columns else inside.reshape(height, width)
        )
        return filled


Shape = Outline | Runs


@dataclass(frozen=True)
class Drawing:
    """The shapes on one image."""

    image: str
    """The name of the image's file, or a text that ends with the number of its frame."""
    size: Size | None
    """Of the image; None where the format does not say."""
    shapes: Sequence[Shape]

    @property
    def classes(self) -> set[str]:
        """The classes that occur."""
        return {shape.label for shape in self.shapes}

    def content(self) -> bytes:
        """Return all that decides its pixels."""
        return json.dumps([self.size, self.shapes]).encode()

    def pixels(self, values: Mapping[str, int], limits: Limits) -> npt.NDArray[np.uint16]:
        """Return the ``(H, W)`` values of the classes, 0 where no shape is.

        A `BadMessage` if a shape does not fit the image, or the size of that is not known.
        """
        if self.size is None:
            raise BadMessage("neither the label nor the log says how large the image is")
        limits.check(*self.size)
        found = np.zeros(self.size[::-1], np.uint16)
        for shape in self.shapes:
            found[shape.fill(self.size)] = values[shape.label]
        return found


class Proposal(NamedTuple):
    """A mask that an annotator is to correct."""

    image: str
    """The name of the image's file."""
    road: Mask
    """``(H, W)``."""

    @property
    def size(self) -> Size:
        """Width and height in pixels."""
        height, width = self.road.shape
        return width, height

    def runs(self, *, by_columns: bool = False) -> list[int]:
        """Return the lengths of its runs, alternately outside and inside, the first outside."""
        flat = self.road.T.ravel() if by_columns else self.road.ravel()
        changes = np.flatnonzero(np.diff(flat, prepend=False))
        lengths: list[int] = np.diff(changes, prepend=0, append=flat.size).tolist()
        return lengths


PROPOSED: Final = "road"
"""The class of what is proposed."""


@dataclass(frozen=True)
class LabelFormat:
    """A kind of files that hold labels.

    `roadeval.logs.truth.beside` parses a file once by its ending: ``.json`` to lists and dicts,
    ``.xml`` to its root element, ``.txt`` to a text.
    """

    name: str
    ending: str
    """Of its files, in lower case."""
    holds: Callable[[Path, Any], bool]
    """Whether a parsed file is of this format."""
    read: Callable[[Path, Any, Size | None], Iterable[Drawing]]
    """Return the label of each image in a parsed file of this format, given the size of the log's
    images. A `LogError` says what cannot be used; a KeyError, TypeError or ValueError means that
    the file is not as the format asks."""
    write: Callable[[Sequence[Proposal]], Mapping[str, bytes]] | None = None
    """Returns the files of masks for an annotator to correct, by their names; None where it writes
    none."""
