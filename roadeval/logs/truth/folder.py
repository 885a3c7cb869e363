"""Labels that are image files or NPY files, one a frame."""

from __future__ import annotations

import io
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.images import Limits
from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.messages.pictures import CompressedPicture, RawPicture
from roadeval.logs.settings import Color
from roadeval.logs.truth.named import NamedLabel
from roadeval.runtime.documents import read_bounded
from roadeval.runtime.files import check_input

NPY: Final = ".npy"
_LONGEST_HEAD: Final = 1 << 16
"""Bytes in which the head of an NPY file of numbers ends."""


def colour_names(folder: Path) -> dict[str, Color]:
    """Return the colours of the classes in CVAT's ``labelmap.txt``, in or above a folder."""
    places = [each / "labelmap.txt" for each in (folder, folder.parent)]
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        return {}
    try:
        lines = read_bounded(found).decode().splitlines()
        pairs = [line.split(":")[:2] for line in lines if line.strip() and line[0] != "#"]
        levels = {name: map(int, rgb.split(",")) for name, rgb in pairs}
        return {name: (red, green, blue) for name, (red, green, blue) in levels.items()}
    except (OSError, ValueError) as error:
        raise LogError(f"{found}: not a list of names and colours: {error}") from error


def file_label(file: Path) -> NamedLabel:
    """Return the label of an image or NPY file."""
    ending = file.suffix.lower()
    if ending == NPY:
        return NamedLabel(file, partial(_content, file), npy_picture)
    return NamedLabel(
        file, partial(_content, file), lambda data, _: CompressedPicture(0, ending[1:], data)
    )


def _content(file: Path) -> bytes:
    check_input(file)
    return file.read_bytes()


def npy_picture(data: bytes, limits: Limits) -> RawPicture:
    """Return the ``(H, W)`` array of an NPY file as a picture of one channel.

    Truth values and whole numbers keep their values, numbers with a fraction become float32.
    Nothing in the file is run: an array of objects is refused by its head. A `BadMessage` if it is
    no NPY file, is cut off, or holds something else. An `ImageError` if it is larger than the
    limits allow.
    """
    head = io.BytesIO(data[:_LONGEST_HEAD])
    try:
        version = np.lib.format.read_magic(head)
        if version == (1, 0):
            shape, by_columns, dtype = np.lib.format.read_array_header_1_0(head)
        else:
            shape, by_columns, dtype = np.lib.format.read_array_header_2_0(head)
    except (ValueError, TypeError, SyntaxError, EOFError, RecursionError, MemoryError) as error:
        raise BadMessage("no NPY file, or its head is damaged") from error
    if len(shape) != 2 or dtype.kind not in "buif":
        raise BadMessage(f"an array of {dtype} of shape {shape}, not of numbers, rows by columns")
    height, width = shape
    limits.check(width, height)
    if len(data) - head.tell() < height * width * dtype.itemsize:
        raise BadMessage(f"an NPY file of {len(data)} bytes that is cut off")
    flat = np.frombuffer(data, dtype, height * width, head.tell())
    encoding, samples = _samples(flat.reshape(shape, order="F" if by_columns else "C"))
    return RawPicture(0, width, height, encoding, 0, big_endian=False, data=samples.tobytes())


def _samples(pixels: npt.NDArray[Any]) -> tuple[str, npt.NDArray[Any]]:
    """Return the name of an encoding, and the numbers in it; refuse what no label can be."""
    is_fraction, greatest = pixels.dtype.kind == "f", np.iinfo(np.uint16).max
    with np.errstate(invalid="ignore"):
        fits = np.isfinite(pixels) if is_fraction else pixels <= greatest
        wrong = pixels[~(fits & (pixels >= 0))]
    if wrong.size and is_fraction:
        raise BadMessage(f"it holds {wrong[0]}, which is neither a class nor a confidence")
    if wrong.size:
        raise BadMessage(f"it holds {wrong[0]}, which is neither from 0 to 65535 nor a fraction")
    if is_fraction:
        return "32FC1", pixels.astype("<f4")
    if pixels.dtype.itemsize == 1:
        return "mono8", pixels.astype("u1")
    return "mono16", pixels.astype("<u2")
