"""Decoding pictures: a camera's to RGB, a label image to whole numbers."""

from __future__ import annotations

import io
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb
from roadeval.logs.container.readers import Buffer
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import CompressedPicture, DecodedPicture, Picture, RawPicture
from roadeval.logs.messages.pixel_formats import eight_bits, format_of, raw_to_rgb, rows_of

Array = npt.NDArray[Any]

JPEG: Final = b"\xff\xd8\xff"
JPEG_END: Final = b"\xff\xd9"
PNG: Final = b"\x89PNG\r\n\x1a\n"
PNG_END: Final = b"IEND"
PALETTE: Final = b"\x03"
"""A PNG's colour type, in its 26th byte, that means a palette."""
TAIL: Final = 4096
"""Bytes at a file's end in which its end mark must lie: some cameras pad their files."""


def media_type(data: Buffer) -> str | None:
    """Return the media type of a JPEG or PNG file, by its first bytes."""
    head = bytes(data[:8])
    if head.startswith(JPEG):
        return "image/jpeg"
    return "image/png" if head == PNG else None


def to_rgb(picture: Picture) -> Rgb:
    """Decode a picture to ``(H, W, 3)`` uint8 RGB.

    16-bit samples keep their upper eight bits, floats count as 0..1, grey fills all channels.

    Raises
    ------
    BadMessage
        If it cannot be decoded.
    """
    import cv2

    if isinstance(picture, DecodedPicture):
        return picture.pixels
    if isinstance(picture, RawPicture):
        return raw_to_rgb(picture)
    return _imdecode(picture, cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION)


def to_labels(picture: Picture) -> Array:
    """Decode a label picture to ``(H, W)`` uint8 or uint16, or to ``(H, W, 3)`` if it has colours.

    Of an image with a palette these are the palette's indices, or its greys if it has only
    greys. An image of three equal channels is a label image of one.

    Raises
    ------
    BadMessage
        If it cannot be decoded.
    """
    import cv2

    if isinstance(picture, RawPicture):
        layout = format_of(picture)
        if layout.is_grey and layout.dtype != "f4":
            return rows_of(picture, layout)
    elif isinstance(picture, CompressedPicture):
        if bytes(picture.data[25:26]) == PALETTE and media_type(picture.data) == "image/png":
            return _indices(picture)
        labels = _imdecode(picture, cv2.IMREAD_UNCHANGED)
        if labels.ndim == 2:
            return labels
    return _grey(to_rgb(picture))


def _grey(colours: Rgb) -> Array:
    grey = colours[..., 0]
    same = np.array_equal(grey, colours[..., 1]) and np.array_equal(grey, colours[..., 2])
    return np.ascontiguousarray(grey) if same else colours


def _indices(picture: CompressedPicture) -> Array:
    """Read a PNG's palette indices, which OpenCV replaces by colours."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(picture.data)) as image:
            indices = np.asarray(image)
            palette = np.array(image.getpalette("RGB"), np.uint8).reshape(-1, 3)
    except (OSError, ValueError, SyntaxError) as error:
        raise BadMessage(f"{len(picture.data)} bytes that are no png image") from error
    used = palette[: int(indices.max()) + 1]
    greys = (used == used[:, :1]).all() and len(used) > 1
    return np.ascontiguousarray(used[indices, 0] if greys else indices)


def _imdecode(picture: CompressedPicture, flags: int) -> Array:
    import cv2

    _check_file(picture)
    try:
        image = cv2.imdecode(np.frombuffer(picture.data, np.uint8), flags)
    except cv2.error:
        image = None
    if image is None:
        name = picture.format or "compressed"
        raise BadMessage(f"{len(picture.data)} bytes that are no {name} image")
    return eight_bits(image) if flags & cv2.IMREAD_COLOR_RGB else np.asarray(image)


def _check_file(picture: CompressedPicture) -> None:
    """Refuse what OpenCV would take for an image: half a file, or a depth map."""
    if "compresseddepth" in picture.format.lower():
        raise BadMessage(f"it holds depth ({picture.format}), which is no camera image")
    media, tail = media_type(picture.data), bytes(picture.data[-TAIL:])
    if (media == "image/jpeg" and JPEG_END not in tail) or (
        media == "image/png" and PNG_END not in tail
    ):
        raise BadMessage(f"a {media.removeprefix('image/')} file that is cut off")
