"""A frame as logged, which can be decoded in any thread."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, Frame, Mask, Rgb
from roadeval.images import Limits, format_of
from roadeval.logs.accounting import Accounting
from roadeval.logs.errors import BadMessage, DamagedMessage, FrameError
from roadeval.logs.messages.pictures import CompressedPicture, Picture
from roadeval.logs.messages.pixels import to_rgb
from roadeval.logs.scaling import at_scale, nearest
from roadeval.logs.topics.labels import Label, LabelPixels

T = TypeVar("T")

TRUTH: Final = "/truth"
SHADOW: Final = "/shadow"
"""Keys among a frame's labels; no mask's name begins with a slash."""


@dataclass(frozen=True, slots=True)
class FrameRules:
    """How frames are decoded.

    Parameters
    ----------
    limits
        On their images: how large, and whether damaged.
    size
        Width and height of the topic's images, if known.
    resize
        Whether labels are resized to the image.
    scale
        Scale of image and labels together.
    """

    limits: Limits
    size: tuple[int, int] | None
    resize: bool
    scale: float


@dataclass(frozen=True, slots=True, eq=False)
class LoggedFrame:
    """A frame as logged, not decoded yet.

    Parameters
    ----------
    number
        Position in the image topic by log time, from 0, undecodable messages included.
    stamp_ns, log_time_ns
        Header stamp (the log time where the log has no stamps) and log time.
    picture
        The image, or why it cannot be read.
    labels
        The labels that belong to it: `TRUTH`, `SHADOW`, and masks by their name.
    rules
        How it is decoded.
    accounting
        Where it says what it found.
    """

    number: int
    stamp_ns: int
    log_time_ns: int
    picture: Picture | FrameError
    labels: Mapping[str, Label]
    rules: FrameRules
    accounting: Accounting

    @property
    def labelled(self) -> bool:
        """Whether the log has truth for it."""
        return TRUTH in self.labels

    def decode(self) -> Frame:
        """Decode image and labels; any thread may do so, and mostly releases the interpreter lock.

        Raises
        ------
        FrameError
            If the image or a label of it cannot be decoded.
        """
        try:
            return at_scale(self._decode(), self.rules.scale)
        except (BadMessage, FrameError) as error:
            reason = f"frame {self.number}: {error}"
            self.accounting.undecodable[self.number] = str(error)
            raise FrameError(reason) from error

    def _decode(self) -> Frame:
        picture = _readable(self.picture)
        image, is_whole = self._pixels(lambda limits: to_rgb(picture, limits))
        self._check_size(image)
        labels = {name: self._label(label, image) for name, label in self.labels.items()}
        truth, shadow = (labels.pop(name, None) for name in (TRUTH, SHADOW))
        return Frame(
            self.number,
            self.stamp_ns,
            self.log_time_ns,
            image,
            picture.data,
            _media_type(picture) if is_whole else None,
            None if truth is None else truth.truth,
            None if shadow is None else shadow.truth,
            {name: _as_mask(label.truth) for name, label in labels.items()},
            {
                name: label.probability
                for name, label in labels.items()
                if label.probability is not None
            },
        )

    def _pixels(self, decode: Callable[[Limits], T], place: str = "") -> tuple[T, bool]:
        """Decode, damaged or not as the limits say; return also whether it was undamaged."""
        try:
            return decode(replace(self.rules.limits, keep_damaged=False)), True
        except DamagedMessage as error:
            if not self.rules.limits.keep_damaged:
                raise
            found = decode(self.rules.limits)
            where = f"{place}: " if place else ""
            self.accounting.damaged[self.number] = f"{where}{error.damage}, used all the same"
            return found, False

    def _check_size(self, image: Rgb) -> None:
        size = image.shape[1], image.shape[0]
        if self.rules.size is not None and size != self.rules.size:
            self.accounting.sizes[self.number] = size

    def _label(self, label: Label, image: Rgb) -> LabelPixels:
        try:
            found, _ = self._pixels(label.read, label.place)
        except BadMessage as error:
            raise FrameError(f"{label.place}: {error}") from error
        if found.fringe:
            self.accounting.fringes[self.number, label.topic] = found.fringe, found.truth.size
        return self._fitted(found, image, label.place)

    def _fitted(self, label: LabelPixels, image: Rgb, place: str) -> LabelPixels:
        height, width = image.shape[:2]
        high, wide = label.truth.shape
        if (high, wide) == (height, width):
            return label
        if not self.rules.resize:
            raise FrameError(
                f"{place} is {wide}x{high}, its image {width}x{height}: "
                "scale the labels with `topics.resize_truth`"
            )
        probability = label.probability
        return replace(
            label,
            truth=nearest(label.truth, (width, height)),
            probability=None if probability is None else nearest(probability, (width, height)),
        )


def _media_type(picture: Picture) -> str | None:
    """Return the media type of a file that every viewer knows."""
    format_ = format_of(picture.data) if isinstance(picture, CompressedPicture) else None
    return format_.media_type if format_ else None


def _readable(picture: Picture | FrameError) -> Picture:
    if isinstance(picture, FrameError):
        raise picture
    return picture


def _as_mask(truth: npt.NDArray[Any]) -> Mask:
    """Make ignored pixels non-road, because a mask has no third value."""
    return np.where(truth == IGNORE, 0, truth).astype(np.uint8)
