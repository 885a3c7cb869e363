"""Decoding of pictures: a camera's to RGB, a label image to whole numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb
from roadeval.images import decoding
from roadeval.images.decoding import eight_bits, whole_numbers, without_colours
from roadeval.images.formats import ImageError, Limits
from roadeval.logs.container.records import Buffer
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import (
    CompressedPicture,
    DecodedPicture,
    Picture,
    RawPicture,
    codec_of,
)

Array = npt.NDArray[Any]

ROUNDING: Final = 1e-3
"""How far rounding, as to 16 bits, may move a fraction beyond 0 or 1."""


@dataclass(frozen=True)
class PixelFormat:
    """The layout of the pixels of an encoding."""

    dtype: str
    channels: int
    """Items of that type for each pixel of a row."""
    code: str | None
    """OpenCV's conversion to RGB; None for RGB itself."""
    rows: float = 1.0
    """Rows stored for each image row: 3/2 for planar 4:2:0, 3 for 4:4:4."""
    block: tuple[int, int] = (1, 1)
    """Width and height of a block of pixels that share their colours."""

    @property
    def is_grey(self) -> bool:
        """Whether a pixel is a single value."""
        return self.code == "COLOR_GRAY2RGB"


FORMATS: Final = {
    "yuv422": PixelFormat("u1", 2, "COLOR_YUV2RGB_UYVY", block=(2, 1)),
    "uyvy": PixelFormat("u1", 2, "COLOR_YUV2RGB_UYVY", block=(2, 1)),
    "yuyv": PixelFormat("u1", 2, "COLOR_YUV2RGB_YUY2", block=(2, 1)),
    "yuv422_yuy2": PixelFormat("u1", 2, "COLOR_YUV2RGB_YUY2", block=(2, 1)),
    "nv12": PixelFormat("u1", 1, "COLOR_YUV2RGB_NV12", 1.5, (2, 2)),
    "nv21": PixelFormat("u1", 1, "COLOR_YUV2RGB_NV21", 1.5, (2, 2)),
    "nv24": PixelFormat("u1", 1, "COLOR_YUV2RGB_YUY2", 3),
    "32fc1": PixelFormat("f4", 1, "COLOR_GRAY2RGB"),
    "8sc1": PixelFormat("i1", 1, "COLOR_GRAY2RGB"),
    "16sc1": PixelFormat("i2", 1, "COLOR_GRAY2RGB"),
    "32sc1": PixelFormat("i4", 1, "COLOR_GRAY2RGB"),
    **{
        name.format(bits): PixelFormat(dtype, channels, code)
        for bits, dtype in ((8, "u1"), (16, "u2"))
        for names, channels, code in (
            ("mono{} {}uc1", 1, "COLOR_GRAY2RGB"),
            ("bgr{} {}uc3", 3, "COLOR_BGR2RGB"),
            ("bgra{} {}uc4", 4, "COLOR_BGRA2RGB"),
            ("rgb{}", 3, None),
            ("rgba{}", 4, "COLOR_RGBA2RGB"),
            ("bayer_rggb{}", 1, "COLOR_BayerRGGB2RGB"),
            ("bayer_bggr{}", 1, "COLOR_BayerBGGR2RGB"),
            ("bayer_grbg{}", 1, "COLOR_BayerGRBG2RGB"),
            ("bayer_gbrg{}", 1, "COLOR_BayerGBRG2RGB"),
        )
        for name in names.split()
    },
}
"""Every raw encoding, by its name in lower case."""


def format_of(picture: RawPicture) -> PixelFormat:
    """Return the pixel format of a picture's encoding; a `BadMessage` if there is none."""
    format_ = FORMATS.get(picture.encoding.lower())
    if format_ is None:
        raise BadMessage(f"its encoding {picture.encoding!r} is unknown")
    return format_


def raw_format(picture: RawPicture, limits: Limits) -> PixelFormat:
    """Return the pixel format of a picture; a `BadMessage` if that or its size is impossible."""
    format_ = format_of(picture)
    with _bad_message():
        limits.check(picture.width, picture.height)
    wide, high = format_.block
    if picture.width % wide or picture.height % high:
        even = "width and height" if high > 1 else "width"
        size = f"{picture.width}x{picture.height}"
        raise BadMessage(f"an image of {size} in {picture.encoding}, which needs an even {even}")
    return format_


def rows_of(picture: RawPicture, limits: Limits) -> Array:
    """Return the samples of a picture as rows, without padding, in this machine's byte order.

    A `BadMessage` as in `raw_format`, or if the data is too short.
    """
    width, height = picture.width, picture.height
    format_ = raw_format(picture, limits)
    rows = int(height * format_.rows)
    dtype = np.dtype(format_.dtype).newbyteorder(">" if picture.big_endian else "<")
    row = width * format_.channels * dtype.itemsize
    step = picture.step or row
    if step < row:
        raise BadMessage(f"an image of {width}x{height} with {step} bytes a row")
    needed = step * (rows - 1) + row
    if len(picture.data) < needed:
        raise BadMessage(f"{len(picture.data)} bytes of pixels where {needed} are needed")
    strides = (step, dtype.itemsize * format_.channels, dtype.itemsize)
    shape = (rows, width, format_.channels)
    array = np.ndarray(shape, dtype, picture.data, 0, strides)
    if format_.channels == 1:
        array = array[..., 0]
    return np.ascontiguousarray(array, dtype.newbyteorder("="))


def to_rgb(picture: Picture, limits: Limits, white: float | None = None) -> Rgb:
    """Decode a picture to ``(H, W, 3)`` uint8 RGB; grey fills all channels.

    ``white`` is the white sample of pictures with more than eight bits: by default the greatest of
    16 bits, or 1 for fractions. A `BadMessage` if the picture is damaged or cannot be decoded.
    """
    if isinstance(picture, DecodedPicture):
        return picture.pixels
    if isinstance(picture, CompressedPicture):
        if _is_depth(picture):
            raise BadMessage(f"it holds depth ({picture.format}), which is not a camera image")
        with _bad_message():
            return decoding.to_rgb(picture.data, limits, white)
    import cv2

    samples, layout = eight_bits(rows_of(picture, limits), white), format_of(picture)
    code = layout.code
    if layout.rows == 3:
        # OpenCV does not know 4:4:4; it is converted as 4:2:2 with each pixel twice.
        y, uv = np.split(samples, [picture.height])
        pairs = np.stack([np.stack([y, y], axis=2), uv.reshape(*y.shape, 2)], axis=3)
        samples = pairs.reshape(picture.height, -1, 2)
    if code is None:
        # The result is a copy, because views of a message are read-only.
        return np.require(samples, requirements=["C", "W"])
    try:
        rgb = cv2.cvtColor(samples, getattr(cv2, code))
    except cv2.error as error:
        size = f"{picture.width}x{picture.height}"
        raise BadMessage(f"an image of {size} in {picture.encoding}: {error.err}") from error
    return np.ascontiguousarray(rgb[:, :: 1 + (layout.rows == 3)], np.uint8)


def deep_samples(picture: Picture, limits: Limits) -> Array | None:
    """Return samples of more than eight bits; None for other pictures. Errors as in `to_rgb`."""
    if isinstance(picture, RawPicture):
        return rows_of(picture, limits) if format_of(picture).dtype != "u1" else None
    file = _file_in(picture)
    if file is None:
        return None
    with _bad_message():
        return decoding.deep_samples(file, limits)


def to_labels(picture: Picture, limits: Limits) -> Array:
    """Decode a label picture to ``(H, W)`` whole numbers, or to ``(H, W, 3)`` if it has colours.

    Fractions become levels of 0..255. Errors as in `label_samples`.
    """
    return whole_numbers(label_samples(picture, limits))


def label_samples(picture: Picture, limits: Limits) -> Array:
    """Decode a label picture to ``(H, W)`` numbers, or to ``(H, W, 3)`` if it has colours.

    An image with a palette gives its indices, or its greys if no entry has a colour. Three equal
    channels count as one. A `BadMessage` as in `to_rgb`.
    """
    if isinstance(picture, RawPicture):
        layout = format_of(picture)
        if layout.is_grey:
            rows = rows_of(picture, limits)
            return rows.astype(np.int16) if layout.dtype == "i1" else rows
    elif isinstance(picture, CompressedPicture):
        with _bad_message():
            return decoding.to_labels(file_of(picture), limits)
    return without_colours(to_rgb(picture, limits))


def palette_of(picture: Picture) -> npt.NDArray[np.uint8] | None:
    """Return the ``(n, 3)`` colours of the values of a PNG with a palette; None for others."""
    if isinstance(picture, RawPicture) or (file := _file_in(picture)) is None:
        return None
    return decoding.palette_of(file)


def size_of(picture: Picture, limits: Limits) -> tuple[int, int] | None:
    """Return width and height by a picture's head; None for video. A `BadMessage` if damaged."""
    if isinstance(picture, RawPicture):
        return picture.width, picture.height
    with _bad_message():
        return None if (file := _file_in(picture)) is None else decoding.size_of(file, limits)


def lossy_format(picture: Picture) -> str:
    """Return the name of a picture's format if that changes values, as JPEG does; else empty."""
    if isinstance(picture, RawPicture):
        return ""
    if (file := _file_in(picture)) is None:
        return "video"
    return decoding.lossy_format(file)


@contextmanager
def _bad_message() -> Iterator[None]:
    try:
        yield
    except ImageError as error:
        raise BadMessage.of(error) from error


def _is_depth(picture: CompressedPicture) -> bool:
    return "compresseddepth" in picture.format.lower()


def _file_in(picture: CompressedPicture | DecodedPicture) -> Buffer | None:
    """Return the image file of a picture; None for video."""
    if isinstance(picture, DecodedPicture) or codec_of(picture) is not None:
        return None
    return file_of(picture)


def file_of(picture: CompressedPicture) -> Buffer:
    """Return a picture's image file; a `BadMessage` if it has depth that is not a PNG."""
    if not _is_depth(picture):
        return picture.data
    if re.search("(?i)32fc1|rvl", picture.format):
        raise BadMessage(f"it holds depth ({picture.format}); of such images PNG of 16UC1 is read")
    return picture.data[12:]  # behind the kind and the quantization
