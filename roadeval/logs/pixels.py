"""From a picture as logged to pixels: RGB for a camera's, whole numbers for a label image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb
from roadeval.logs.messages import BadMessage, CompressedPicture, Picture, RawPicture

Array = npt.NDArray[Any]

JPEG: Final = b"\xff\xd8\xff"
PNG: Final = b"\x89PNG\r\n\x1a\n"
LARGEST: Final = 1 << 28
"""Pixels: more is a damaged head, not a camera."""


@dataclass(frozen=True, slots=True)
class Layout:
    """How an encoding lays out its pixels.

    ``dtype`` and ``channels`` give a row's items; ``rows`` the rows stored per image row (3/2
    for planar 4:2:0); ``code`` names OpenCV's conversion to RGB, None for RGB itself.
    """

    dtype: str
    channels: int
    code: str | None
    rows: float = 1.0


def _layouts() -> dict[str, Layout]:
    layouts = {
        "yuv422": Layout("u1", 2, "COLOR_YUV2RGB_UYVY"),
        "uyvy": Layout("u1", 2, "COLOR_YUV2RGB_UYVY"),
        "yuyv": Layout("u1", 2, "COLOR_YUV2RGB_YUY2"),
        "yuv422_yuy2": Layout("u1", 2, "COLOR_YUV2RGB_YUY2"),
        "nv12": Layout("u1", 1, "COLOR_YUV2RGB_NV12", 1.5),
        "nv21": Layout("u1", 1, "COLOR_YUV2RGB_NV21", 1.5),
        "32fc1": Layout("f4", 1, "COLOR_GRAY2RGB"),
    }
    for bits, dtype in (("8", "u1"), ("16", "u2")):
        layouts |= {
            f"mono{bits}": Layout(dtype, 1, "COLOR_GRAY2RGB"),
            f"{bits}uc1": Layout(dtype, 1, "COLOR_GRAY2RGB"),
            f"rgb{bits}": Layout(dtype, 3, None),
            f"bgr{bits}": Layout(dtype, 3, "COLOR_BGR2RGB"),
            f"{bits}uc3": Layout(dtype, 3, "COLOR_BGR2RGB"),
            f"rgba{bits}": Layout(dtype, 4, "COLOR_RGBA2RGB"),
            f"bgra{bits}": Layout(dtype, 4, "COLOR_BGRA2RGB"),
            f"{bits}uc4": Layout(dtype, 4, "COLOR_BGRA2RGB"),
        }
        for order in ("rggb", "bggr", "grbg", "gbrg"):
            code = f"COLOR_Bayer{order.upper()}2RGB"
            layouts[f"bayer_{order}{bits}"] = Layout(dtype, 1, code)
    return layouts


LAYOUTS: Final = _layouts()
"""Every raw encoding, by its name in lower case."""


def media_type(data: bytes | memoryview) -> str | None:
    """Tell by its first bytes whether ``data`` is a JPEG or PNG file."""
    head = bytes(data[:8])
    if head.startswith(JPEG):
        return "image/jpeg"
    return "image/png" if head == PNG else None


def to_rgb(picture: Picture) -> Rgb:
    """Decode a camera's picture to ``(H, W, 3)`` uint8 RGB.

    16-bit samples keep their upper eight bits, floats count as 0..1, grey fills all channels.

    Raises
    ------
    BadMessage
        If it cannot be decoded.
    """
    if isinstance(picture, RawPicture):
        return _raw_to_rgb(picture)
    import cv2

    flags = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
    return _imdecode(picture, flags).astype(np.uint8, copy=False)


def to_labels(picture: Picture) -> Array:
    """Decode a label picture to ``(H, W)`` uint8 or uint16, or to ``(H, W, 3)`` uint8 RGB.

    An image of three equal channels is a label image of one.

    Raises
    ------
    BadMessage
        If it cannot be decoded.
    """
    import cv2

    if isinstance(picture, RawPicture):
        layout = _layout(picture)
        if layout.code == "COLOR_GRAY2RGB" and layout.dtype != "f4":
            return _rows(picture, layout)
        colours: Array = _raw_to_rgb(picture)
    else:
        colours = _imdecode(picture, cv2.IMREAD_UNCHANGED)
        if colours.ndim == 3:
            code = cv2.COLOR_BGRA2RGB if colours.shape[2] == 4 else cv2.COLOR_BGR2RGB
            colours = np.asarray(cv2.cvtColor(colours, code))
    if colours.ndim == 2:
        return colours
    grey = colours[..., 0]
    same = np.array_equal(grey, colours[..., 1]) and np.array_equal(grey, colours[..., 2])
    return np.ascontiguousarray(grey) if same else colours


def _imdecode(picture: CompressedPicture, flags: int) -> Array:
    import cv2

    try:
        image = cv2.imdecode(np.frombuffer(picture.data, np.uint8), flags)
    except cv2.error:
        image = None
    if image is None:
        name = picture.format or "compressed"
        raise BadMessage(f"{len(picture.data)} bytes that are no {name} image")
    return np.asarray(image)


def _layout(picture: RawPicture) -> Layout:
    layout = LAYOUTS.get(picture.encoding.lower())
    if layout is None:
        raise BadMessage(f"its encoding {picture.encoding!r} is unknown")
    return layout


def _rows(picture: RawPicture, layout: Layout) -> Array:
    """View the data as rows of samples, without padding and in this machine's byte order."""
    width, height = picture.width, picture.height
    rows = int(height * layout.rows)
    dtype = np.dtype(layout.dtype).newbyteorder(">" if picture.big_endian else "<")
    row = width * layout.channels * dtype.itemsize
    step = picture.step or row
    if not 0 < width * height <= LARGEST or step < row:
        raise BadMessage(f"an image of {width}x{height} with {step} bytes a row")
    needed = step * (rows - 1) + row
    if len(picture.data) < needed:
        raise BadMessage(f"{len(picture.data)} bytes of pixels where {needed} are needed")
    strides = (step, dtype.itemsize * layout.channels, dtype.itemsize)
    shape = (rows, width, layout.channels)
    array = np.ndarray(shape, dtype, picture.data, 0, strides)
    if layout.channels == 1:
        array = array[..., 0]
    return np.ascontiguousarray(array, dtype.newbyteorder("="))


def _raw_to_rgb(picture: RawPicture) -> Rgb:
    import cv2

    layout = _layout(picture)
    samples = _eight_bits(_rows(picture, layout))
    if layout.code is None:
        return samples
    rgb: Rgb = np.asarray(cv2.cvtColor(samples, getattr(cv2, layout.code)), np.uint8)
    return rgb


def _eight_bits(array: Array) -> npt.NDArray[np.uint8]:
    if array.dtype == np.uint16:
        return (array >> 8).astype(np.uint8)
    if array.dtype == np.float32:
        return np.rint(np.clip(np.nan_to_num(array), 0, 1) * 255).astype(np.uint8)
    return np.asarray(array, np.uint8)
