"""Formats of image files, told by the files' first bytes, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

from roadeval.errors import RoadevalError
from roadeval.runtime.sentence import Sentence

MAX_PIXELS: Final = 1 << 25
"""Most pixels of an image by default: 33.6 million, a little more than 7680x4320."""


class ImageError(RoadevalError, ValueError):
    """An image that is damaged, of an unknown format, or too large to be read.

    Its message completes "frame 7: ...".
    """


@dataclass(frozen=True)
class Limits:
    """How large an image may be, and how it is taken."""

    max_pixels: int = MAX_PIXELS
    """Most pixels. An image's own head says how many it has, so none is decoded that has more."""
    turn: bool = False
    """Whether an image whose EXIF orientation says so is turned, as viewers do."""
    full_range: bool = False
    """Whether a video's luma spans 0 to 255, whatever the video says, and not 16 to 235."""

    def check(self, width: int, height: int) -> None:
        """Refuse a size; an `ImageError` if it is empty or too large."""
        if width <= 0 or height <= 0:
            raise ImageError(f"an image of {width}x{height}")
        if width * height > self.max_pixels:
            raise ImageError(
                Sentence(
                    "an image of {}x{}, more than the {} pixels that {frames.max_pixels} allows",
                    width,
                    height,
                    self.max_pixels,
                )
            )


class ImageFormat(NamedTuple):
    """A format that is read."""

    name: str
    skipped: int
    """Bytes before the magic ones."""
    magic: bytes
    plugin: str | None
    """Name of Pillow's module and class for it; None for JPEG, which another library reads."""
    media_type: str | None = None
    """What viewers call it; None for formats that not all of them know."""
    exact: bool = True
    """Whether it keeps every pixel's value. Of formats that can do both, the answer is no."""


FORMATS: Final = (
    ImageFormat("JPEG", 0, b"\xff\xd8\xff", None, "image/jpeg", exact=False),
    ImageFormat("PNG", 0, b"\x89PNG\r\n\x1a\n", "Png", "image/png"),
    ImageFormat("WebP without loss", 8, b"WEBPVP8L", "WebP"),
    ImageFormat("WebP", 8, b"WEBP", "WebP", exact=False),
    ImageFormat("AVIF", 4, b"ftypavif", "Avif", exact=False),
    ImageFormat("JPEG 2000", 4, b"jP  ", "Jpeg2K", exact=False),
    ImageFormat("TIFF", 0, b"II*\0", "Tiff"),
    ImageFormat("TIFF", 0, b"MM\0*", "Tiff"),
    ImageFormat("BMP", 0, b"BM", "Bmp"),
    ImageFormat("PGM", 0, b"P5", "Ppm"),
    ImageFormat("PPM", 0, b"P6", "Ppm"),
)
"""Every format that is read; the first that fits is the file's."""


def format_of(data: bytes | memoryview) -> ImageFormat | None:
    """Return the format of a file, None if it is none of these."""
    head = bytes(data[:16])
    return next((one for one in FORMATS if head.startswith(one.magic, one.skipped)), None)
