"""One frame as logged: decoded when it is wanted, in whatever thread wants it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, Frame, Mask, Rgb, Truth
from roadeval.logs.errors import BadMessage, FrameError
from roadeval.logs.messages.pictures import CompressedPicture, Picture
from roadeval.logs.messages.pixels import media_type, to_rgb
from roadeval.logs.topics.labels import LabelMap

TRUTH: Final = "/truth"
SHADOW: Final = "/shadow"
"""Keys among a frame's labels; no mask's name begins with a slash."""


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A label's picture, or why it cannot be read, and how to understand it."""

    picture: Picture | FrameError
    labels: LabelMap
    topic: str


class LoggedFrame:
    """One frame as logged, not decoded yet.

    Attributes
    ----------
    number
        Position in the image topic by log time, from 0, undecodable messages included.
    stamp_ns, log_time_ns
        Header stamp (the log time where the log has no stamps) and log time.
    labelled
        Whether the log has truth for it.
    """

    __slots__ = (
        *("_labels", "_picture", "_report", "_resize", "_scale"),
        *("log_time_ns", "number", "stamp_ns"),
    )

    def __init__(
        self,
        number: int,
        stamp_ns: int,
        log_time_ns: int,
        picture: Picture | FrameError,
        labels: Mapping[str, Label],
        *,
        resize: bool,
        scale: float = 1.0,
        report: Callable[[int, str], None],
    ) -> None:
        self.number = number
        self.stamp_ns = stamp_ns
        self.log_time_ns = log_time_ns
        self._picture = picture
        self._labels = labels
        self._resize = resize
        self._scale = scale
        self._report = report

    @property
    def labelled(self) -> bool:
        """Whether the log has truth for it."""
        return TRUTH in self._labels

    def decode(self) -> Frame:
        """Decode image and labels; can be called from any thread, and mostly frees it.

        Raises
        ------
        FrameError
            If the image or a label of it cannot be decoded.
        """
        try:
            return at_scale(self._decode(), self._scale)
        except (BadMessage, FrameError) as error:
            reason = f"frame {self.number}: {error}"
            self._report(self.number, str(error))
            raise FrameError(reason) from error

    def _decode(self) -> Frame:
        picture = _readable(self._picture)
        image = to_rgb(picture)
        labels = {name: self._label(label, image) for name, label in self._labels.items()}
        truth, shadow = labels.pop(TRUTH, None), labels.pop(SHADOW, None)
        media = media_type(picture.data) if isinstance(picture, CompressedPicture) else None
        return Frame(
            self.number,
            self.stamp_ns,
            self.log_time_ns,
            image,
            picture.data,
            media,
            truth,
            shadow,
            {name: _as_mask(mask) for name, mask in labels.items()},
        )

    def _label(self, label: Label, image: Rgb) -> Truth:
        try:
            truth = label.labels.read(_readable(label.picture))
        except BadMessage as error:
            raise FrameError(f"{label.topic}: {error}") from error
        return self._fitted(truth, image, label.topic)

    def _fitted(self, truth: Truth, image: Rgb, topic: str) -> Truth:
        height, width = image.shape[:2]
        if truth.shape == (height, width):
            return truth
        if not self._resize:
            size = f"{truth.shape[1]}x{truth.shape[0]}"
            raise FrameError(f"{topic} is {size}, its image {width}x{height}: see --resize-truth")
        return _nearest(truth, (width, height))


def scaled_size(size: tuple[int, int], scale: float) -> tuple[int, int]:
    """Scale a width and height, to whole pixels."""
    width, height = (max(1, round(length * scale)) for length in size)
    return width, height


def at_scale(frame: Frame, scale: float) -> Frame:
    """Reduce a frame to a share of its width and height, at most 1.

    Colours are averaged over the area of each new pixel; labels are the nearest pixel's. The
    file that the log holds is no longer this image's, and only stands for its identity.
    """
    if scale == 1:
        return frame
    import cv2

    size = scaled_size((frame.image.shape[1], frame.image.shape[0]), scale)
    return replace(
        frame,
        image=cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA),
        media_type=None,
        truth=None if frame.truth is None else _nearest(frame.truth, size),
        shadow_truth=None if frame.shadow_truth is None else _nearest(frame.shadow_truth, size),
        external={name: _nearest(mask, size) for name, mask in frame.external.items()},
    )


def _nearest(labels: Truth, size: tuple[int, int]) -> Truth:
    """Bring labels to a width and height, by the nearest pixel."""
    import cv2

    how = cv2.INTER_NEAREST_EXACT
    return np.asarray(cv2.resize(labels, size, interpolation=how), np.uint8)


def _readable(picture: Picture | FrameError) -> Picture:
    if isinstance(picture, FrameError):
        raise picture
    return picture


def _as_mask(truth: npt.NDArray[Any]) -> Mask:
    """Take what a mask leaves open for non-road: a mask has no third value."""
    return np.where(truth == IGNORE, 0, truth).astype(np.uint8)
