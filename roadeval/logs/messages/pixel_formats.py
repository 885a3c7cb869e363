"""Pixel formats of raw images, and their conversion to RGB."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import RawPicture

Array = npt.NDArray[Any]

LARGEST: Final = 1 << 28
"""Most pixels of an image; one that claims more is damaged."""


@dataclass(frozen=True, slots=True)
class PixelFormat:
    """How an encoding lays out its pixels.

    ``dtype`` and ``channels`` give a row's items; ``rows`` the rows stored per image row (3/2
    for planar 4:2:0); ``code`` names OpenCV's conversion to RGB, None for RGB itself.
    """

    dtype: str
    channels: int
    code: str | None
    rows: float = 1.0

    @property
    def is_grey(self) -> bool:
        """Whether a pixel is a single value."""
        return self.code == "COLOR_GRAY2RGB"


def _formats() -> dict[str, PixelFormat]:
    formats = {
        "yuv422": PixelFormat("u1", 2, "COLOR_YUV2RGB_UYVY"),
        "uyvy": PixelFormat("u1", 2, "COLOR_YUV2RGB_UYVY"),
        "yuyv": PixelFormat("u1", 2, "COLOR_YUV2RGB_YUY2"),
        "yuv422_yuy2": PixelFormat("u1", 2, "COLOR_YUV2RGB_YUY2"),
        "nv12": PixelFormat("u1", 1, "COLOR_YUV2RGB_NV12", 1.5),
        "nv21": PixelFormat("u1", 1, "COLOR_YUV2RGB_NV21", 1.5),
        "32fc1": PixelFormat("f4", 1, "COLOR_GRAY2RGB"),
    }
    for bits, dtype in (("8", "u1"), ("16", "u2")):
        formats |= {
            f"mono{bits}": PixelFormat(dtype, 1, "COLOR_GRAY2RGB"),
            f"{bits}uc1": PixelFormat(dtype, 1, "COLOR_GRAY2RGB"),
            f"rgb{bits}": PixelFormat(dtype, 3, None),
            f"bgr{bits}": PixelFormat(dtype, 3, "COLOR_BGR2RGB"),
            f"{bits}uc3": PixelFormat(dtype, 3, "COLOR_BGR2RGB"),
            f"rgba{bits}": PixelFormat(dtype, 4, "COLOR_RGBA2RGB"),
            f"bgra{bits}": PixelFormat(dtype, 4, "COLOR_BGRA2RGB"),
            f"{bits}uc4": PixelFormat(dtype, 4, "COLOR_BGRA2RGB"),
        }
        for order in ("rggb", "bggr", "grbg", "gbrg"):
            code = f"COLOR_Bayer{order.upper()}2RGB"
            formats[f"bayer_{order}{bits}"] = PixelFormat(dtype, 1, code)
    return formats


FORMATS: Final = _formats()
"""Every raw encoding, by its name in lower case."""


def format_of(picture: RawPicture) -> PixelFormat:
    """Return the pixel format of a picture's encoding.

    Raises
    ------
    BadMessage
        If there is none.
    """
    format_ = FORMATS.get(picture.encoding.lower())
    if format_ is None:
        raise BadMessage(f"its encoding {picture.encoding!r} is unknown")
    return format_


def rows_of(picture: RawPicture, format_: PixelFormat) -> Array:
    """Return the samples of a picture as rows, without padding, in this machine's byte order.

    Raises
    ------
    BadMessage
        If the data is shorter than its size says, or the size cannot be.
    """
    width, height = picture.width, picture.height
    rows = int(height * format_.rows)
    dtype = np.dtype(format_.dtype).newbyteorder(">" if picture.big_endian else "<")
    row = width * format_.channels * dtype.itemsize
    step = picture.step or row
    if not 0 < width * height <= LARGEST or step < row:
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


def raw_to_rgb(picture: RawPicture) -> Rgb:
    """Convert a picture to ``(H, W, 3)`` uint8 RGB, an array of its own.

    Raises
    ------
    BadMessage
        If its encoding is unknown or its data too short.
    """
    import cv2

    format_ = format_of(picture)
    samples = eight_bits(rows_of(picture, format_))
    if format_.code is None:
        # A loop is compiled anew for parts of a message: they may not be written to.
        return np.require(samples, requirements=["C", "W"])
    rgb: Rgb = np.asarray(cv2.cvtColor(samples, getattr(cv2, format_.code)), np.uint8)
    return rgb


def eight_bits(array: Array) -> npt.NDArray[np.uint8]:
    """Convert samples to 0..255: the upper half of 16 bits, floats from 0..1."""
    if array.dtype == np.uint16:
        array = array >> 8
    elif array.dtype == np.float32:
        array = np.rint(np.clip(np.nan_to_num(array), 0, 1) * 255)
    return np.asarray(array, np.uint8)
