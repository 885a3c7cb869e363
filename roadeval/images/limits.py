"""Limits on the images that are read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from roadeval.images.errors import ImageError

MAX_PIXELS: Final = 1 << 25
"""Most pixels of an image by default: 33.6 million, a little more than 7680x4320."""


@dataclass(frozen=True, slots=True)
class Limits:
    """How large an image may be, and whether it may be damaged.

    Parameters
    ----------
    max_pixels
        Most pixels. An image's own head says how many it has, so none is decoded that has more.
    keep_damaged
        Whether to decode a damaged file as far as it goes.
    """

    max_pixels: int = MAX_PIXELS
    keep_damaged: bool = False

    def check(self, width: int, height: int) -> None:
        """Refuse a size; an `ImageError` if it is empty or too large."""
        if width <= 0 or height <= 0:
            raise ImageError(f"an image of {width}x{height}")
        if width * height > self.max_pixels:
            raise ImageError(
                f"an image of {width}x{height}, more than the {self.max_pixels} pixels that "
                "`frames.max_pixels` allows"
            )
