"""A frame as logged, which can be decoded in any thread."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, Frame, Mask, Rgb, Truth
from roadeval.logs.errors import BadMessage, FrameError
from roadeval.logs.messages.pictures import CompressedPicture, Picture
from roadeval.logs.messages.pixels import media_type, to_rgb
from roadeval.logs.scaling import at_scale, nearest
from roadeval.logs.topics.labels import Label

TRUTH: Final = "/truth"
SHADOW: Final = "/shadow"
"""Keys among a frame's labels; no mask's name begins with a slash."""


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
    resize, scale
        Whether labels are resized to the image, and the scale of both together.
    report
        Called with the number and the reason if it cannot be decoded.
    """

    number: int
    stamp_ns: int
    log_time_ns: int
    picture: Picture | FrameError
    labels: Mapping[str, Label]
    resize: bool
    scale: float
    report: Callable[[int, str], None]

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
            return at_scale(self._decode(), self.scale)
        except (BadMessage, FrameError) as error:
            reason = f"frame {self.number}: {error}"
            self.report(self.number, str(error))
            raise FrameError(reason) from error

    def _decode(self) -> Frame:
        picture = _readable(self.picture)
        image = to_rgb(picture)
        labels = {name: self._label(label, image) for name, label in self.labels.items()}
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
        if not self.resize:
            size = f"{truth.shape[1]}x{truth.shape[0]}"
            raise FrameError(
                f"{topic} is {size}, its image {width}x{height}: "
                "scale the labels with `topics.resize_truth`"
            )
        return nearest(truth, (width, height))


def _readable(picture: Picture | FrameError) -> Picture:
    if isinstance(picture, FrameError):
        raise picture
    return picture


def _as_mask(truth: npt.NDArray[Any]) -> Mask:
    """Make ignored pixels non-road, because a mask has no third value."""
    return np.where(truth == IGNORE, 0, truth).astype(np.uint8)
