"""Decoding pictures: a camera's to RGB, a label image to whole numbers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy.typing as npt

from roadeval import images
from roadeval.data import Rgb
from roadeval.images import DamagedImageError, ImageError, Limits
from roadeval.images.decoding import without_colours
from roadeval.logs.container.readers import Buffer
from roadeval.logs.errors import BadMessage, DamagedMessage
from roadeval.logs.messages.pictures import (
    CompressedPicture,
    DecodedPicture,
    Picture,
    RawPicture,
    codec_of,
)
from roadeval.logs.messages.pixel_formats import (
    PixelFormat,
    check_size,
    format_of,
    raw_to_rgb,
    rows_of,
)

Array = npt.NDArray[Any]


def to_rgb(picture: Picture, limits: Limits) -> Rgb:
    """Decode a picture to ``(H, W, 3)`` uint8 RGB.

    16-bit samples keep their upper eight bits, floats count as 0..1, grey fills all channels.

    Raises
    ------
    BadMessage
        If it cannot be decoded; a `DamagedMessage` if it is damaged and the limits forbid that.
    """
    with _bad_message():
        if isinstance(picture, RawPicture):
            return raw_to_rgb(picture, limits)
        if isinstance(picture, DecodedPicture):
            return _video_frame(picture, limits)
        return images.to_rgb(_image_file(picture), limits)


def to_labels(picture: Picture, limits: Limits) -> Array:
    """Decode a label picture to ``(H, W)`` uint8 or uint16, or to ``(H, W, 3)`` if it has colours.

    Of an image with a palette these are the palette's indices, or its greys if it has only
    greys. An image of three equal channels is a label image of one.

    Raises
    ------
    BadMessage
        As `to_rgb`.
    """
    if isinstance(picture, RawPicture):
        layout = format_of(picture)
        if layout.is_grey and layout.dtype != "f4":
            with _bad_message():
                return rows_of(picture, layout, limits)
    elif isinstance(picture, CompressedPicture):
        with _bad_message():
            return images.to_labels(_image_file(picture), limits)
    return without_colours(to_rgb(picture, limits))


def raw_format(picture: RawPicture, limits: Limits) -> PixelFormat:
    """Return the pixel format of a picture; a `BadMessage` if that or its size cannot be."""
    with _bad_message():
        format_ = format_of(picture)
        check_size(picture, format_, limits)
        return format_


def size_of(picture: Picture) -> tuple[int, int] | None:
    """Return width and height by what a picture's head says; None of video, which has none.

    Raises
    ------
    BadMessage
        If the head cannot be read.
    """
    if isinstance(picture, RawPicture):
        return picture.width, picture.height
    if isinstance(picture, DecodedPicture) or codec_of(picture) is not None:
        return None
    with _bad_message():
        return images.size_of(picture.data)


def lossy_format(picture: Picture) -> str:
    """Name the format of a picture whose compression changes values, as JPEG; else empty."""
    if isinstance(picture, RawPicture):
        return ""
    if isinstance(picture, DecodedPicture) or codec_of(picture) is not None:
        return "video"
    format_ = images.format_of(picture.data)
    return "" if format_ is None or format_.exact else format_.name


@contextmanager
def _bad_message() -> Iterator[None]:
    try:
        yield
    except DamagedImageError as error:
        raise DamagedMessage(str(error)) from error
    except ImageError as error:
        raise BadMessage(str(error)) from error


def _image_file(picture: CompressedPicture) -> Buffer:
    """Return the file, unless it holds a depth map, which decodes like a camera image."""
    if "compresseddepth" in picture.format.lower():
        raise BadMessage(f"it holds depth ({picture.format}), which is no camera image")
    return picture.data


def _video_frame(picture: DecodedPicture, limits: Limits) -> Rgb:
    if picture.damage and not limits.keep_damaged:
        raise DamagedMessage(picture.damage)
    return picture.pixels
