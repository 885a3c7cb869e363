"""NPY files as pictures. Nothing in them is run: an array of objects is refused by its head."""

from __future__ import annotations

import io
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.images import Limits
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import RawPicture

ENDING: Final = ".npy"
_LONGEST_HEAD: Final = 1 << 16
"""Bytes in which the head of a file of numbers ends."""


def npy_picture(data: bytes, limits: Limits) -> RawPicture:
    """Return the ``(H, W)`` array of an NPY file as a picture of one channel.

    Truth values and whole numbers keep their values, numbers with a fraction become float32.

    Raises
    ------
    BadMessage
        If it is no NPY file, is cut off, or holds something else.
    ImageError
        If it is larger than the limits allow.
    """
    shape, by_columns, dtype, begin = _head(data)
    if len(shape) != 2 or dtype.kind not in "buif":
        raise BadMessage(f"an array of {dtype} of shape {shape}, not of numbers, rows by columns")
    height, width = shape
    limits.check(width, height)
    if len(data) - begin < height * width * dtype.itemsize:
        raise BadMessage(f"an NPY file of {len(data)} bytes that is cut off")
    flat = np.frombuffer(data, dtype, height * width, begin)
    pixels = flat.reshape(shape, order="F" if by_columns else "C")
    encoding, samples = _samples(pixels)
    return RawPicture(0, width, height, encoding, 0, big_endian=False, data=samples.tobytes())


def _head(data: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Return shape, order, type, and the place of the first number."""
    file = io.BytesIO(data[:_LONGEST_HEAD])
    try:
        version = np.lib.format.read_magic(file)
        if version == (1, 0):
            head = np.lib.format.read_array_header_1_0(file)
        else:
            head = np.lib.format.read_array_header_2_0(file)
    except (ValueError, TypeError, SyntaxError, EOFError, RecursionError, MemoryError) as error:
        raise BadMessage("no NPY file, or its head is damaged") from error
    return *head, file.tell()


def _samples(pixels: npt.NDArray[Any]) -> tuple[str, npt.NDArray[Any]]:
    """Return the name of an encoding, and the numbers as it has them."""
    if pixels.dtype.kind == "f":
        wrong = pixels[~(np.isfinite(pixels) & (pixels >= 0))]
        if wrong.size:
            raise BadMessage(f"it holds {wrong[0]}, which is neither a class nor a confidence")
        return "32FC1", pixels.astype("<f4")
    if pixels.dtype.itemsize == 1 and pixels.dtype.kind in "bu":
        return "mono8", pixels.astype("u1")
    wrong = pixels[(pixels < 0) | (pixels > np.iinfo(np.uint16).max)]
    if wrong.size:
        raise BadMessage(f"it holds {wrong[0]}, which is neither from 0 to 65535 nor a fraction")
    return "mono16", pixels.astype("<u2")
