"""Formats of image files, told by the files' first bytes."""

from __future__ import annotations

from typing import Final, NamedTuple


class ImageFormat(NamedTuple):
    """A format that is read.

    Parameters
    ----------
    name
        As a person calls it.
    skipped, magic
        How many bytes to skip at the file's begin, and those that follow.
    plugin
        Name of Pillow's module and class for it; None for JPEG, which another library reads.
    media_type
        What viewers call it; None for formats that not all of them know.
    exact
        Whether it keeps every pixel's value. Of formats that can do both, the answer is no.
    """

    name: str
    skipped: int
    magic: bytes
    plugin: str | None
    media_type: str | None = None
    exact: bool = True


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
    return next((each for each in FORMATS if head.startswith(each.magic, each.skipped)), None)
