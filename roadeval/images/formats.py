"""Formats of image files, recognised by their first bytes, and limits of their size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

from roadeval.errors import RoadevalError
from roadeval.runtime.sentence import Sentence

Size = tuple[int, int]
"""Width and height in pixels."""
MAX_PIXELS: Final = 1 << 25
"""Greatest number of pixels of an image by default: 33.6 million, a little more than 7680x4320."""


class ImageError(RoadevalError, ValueError):
    """An image that is damaged, too large, or of an unknown format; it follows "frame 7: "."""


@dataclass(frozen=True)
class Limits:
    """The largest size of an image, and rules for decoding it."""

    max_pixels: int = MAX_PIXELS
    """Greatest number of pixels. The head of an image tells its size, so larger ones are not
    decoded."""
    turn: bool = False
    """Whether an image is turned by its EXIF orientation, as in viewers."""
    full_range: bool = False
    """Whether the luma of a video spans 0 to 255, whatever the video states."""

    def check(self, width: int, height: int) -> None:
        """Raise an `ImageError` if a size is empty or too large."""
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
    """A format of image files."""

    name: str
    skipped: int
    """Number of bytes before the magic bytes."""
    magic: bytes
    plugin: str | None
    """Name of its module and class in Pillow; None for JPEG, which another library reads."""
    media_type: str | None = None
    """Its media type, if all viewers know it."""
    exact: bool = True
    """Whether it always keeps the value of every pixel."""


FORMATS: Final = (
    ImageFormat("JPEG", 0, b"\xff\xd8\xff", None, "image/jpeg", exact=False),
    ImageFormat("PNG", 0, b"\x89PNG\r\n\x1a\n", "Png", "image/png"),
    ImageFormat("WebP without loss", 8, b"WEBPVP8L", "WebP"),
    ImageFormat("WebP", 8, b"WEBP", "WebP", exact=False),
    ImageFormat("AVIF", 4, b"ftypavif", "Avif", exact=False),
    ImageFormat("JPEG 2000", 4, b"jP  ", "Jpeg2K", exact=False),
    ImageFormat("TIFF", 0, b"II*\0", "Tiff"),
    ImageFormat("TIFF", 0, b"MM\0*", "Tiff"),
    ImageFormat("TIFF", 0, b"II+\0", "Tiff"),
    ImageFormat("TIFF", 0, b"MM\0+", "Tiff"),
    ImageFormat("BMP", 0, b"BM", "Bmp"),
    ImageFormat("PGM", 0, b"P5", "Ppm"),
    ImageFormat("PPM", 0, b"P6", "Ppm"),
)
"""Every format, in the order in which files are compared with them."""


def format_of(data: bytes | memoryview) -> ImageFormat | None:
    """Return the format of a file, None if it is none of these."""
    head = bytes(data[:16])
    return next((f for f in FORMATS if head.startswith(f.magic, f.skipped)), None)
