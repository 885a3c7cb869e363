"""A folder of label images or NPY files, a file a frame, read as a topic of label images is."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.images import ImageError, Limits
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.files import IMAGES, bare, listed, ordered, time_in
from roadeval.logs.messages.pictures import CompressedPicture, Picture, RawPicture
from roadeval.logs.settings import MaskSettings
from roadeval.runtime.files import check_input
from roadeval.runtime.text import visible

NPY: Final = ".npy"
LABELS: Final = IMAGES | {NPY}
"""Endings of the files that can be labels."""
_LAST_NUMBER: Final = re.compile(r"(\d+)\D*$")
SHORT: Final = 10
"""Digits of what may be a time in seconds, or a frame's number with zeros before it."""
_DIGITS: Final = 18
"""Most digits of a number that 64 bits hold."""
_LONGEST_HEAD: Final = 1 << 16
"""Bytes in which the head of an NPY file of numbers ends."""


@dataclass(frozen=True, eq=False)
class LabelFolder:
    """The label files of a folder, each with its key: the number, or the stamp, of its frame."""

    path: Path
    files: tuple[Path, ...]
    """In the order of their keys."""
    log_times: npt.NDArray[np.int64]
    """``(n,)``: the keys, rising."""
    by: str
    """``number``, ``stamp`` or ``name``: where the keys come from."""
    limits: Limits
    """On the images."""
    nameless: int = 0
    """Further files, whose name no image has."""
    images: int | None = None
    """How many images the folder holds whose names they have; None where names mean nothing."""

    @property
    def name(self) -> str:
        """The folder, for messages."""
        return visible(str(self.path))

    @property
    def sure(self) -> int:
        """All of them: their keys are their names."""
        return len(self.files)

    def __len__(self) -> int:
        return len(self.files)

    def stamp(self, position: int) -> int:
        """Return the key of a file."""
        return int(self.log_times[position])

    def picture(self, position: int) -> Picture:
        """Read a file; a `FrameError` if it cannot be read."""
        file = self.files[position]
        try:
            data = _content(file)
            if file.suffix.lower() == NPY:
                return npy_picture(data, self.limits)
            return CompressedPicture(0, file.suffix[1:].lower(), data)
        except OSError as error:
            raise FrameError(f"{self.place(position)}: {error.strerror}") from error
        except (BadMessage, ImageError) as error:
            raise FrameError(f"{self.place(position)}: {error}") from error

    def place(self, position: int) -> str:
        """Return a file's path, for messages to people."""
        return visible(str(self.files[position]))

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all keys and files, in hexadecimal; a `LogError` if one cannot be read."""
        digest = hashlib.sha256()
        for key, file in zip(self.log_times.tolist(), self.files, strict=True):
            try:
                content = _content(file)
            except OSError as error:
                raise LogError(f"{file}: {error.strerror}") from error
            digest.update(f"{key} {hashlib.sha256(content).hexdigest()}\n".encode())
        return digest.hexdigest()


def open_folder(path: Path, settings: MaskSettings, limits: Limits) -> LabelFolder:
    """List the label files of a folder, and find the key of each.

    Raises
    ------
    LogError
        If there is none, or a name has no key, or two files have the same.
    """
    if path.suffix == ".mcap" and path.is_file():
        raise LogError(f"{path}: a log; name a topic of it, as {path}:/topic")
    files = listed(path, LABELS)
    named = None if settings.images is None else _places(Path(settings.images))
    by, keys = _keys(files, settings, named)
    places = sorted(keys, key=keys.__getitem__)
    for one, other in pairwise(places):
        if keys[one] == keys[other]:
            both = f"{visible(one.name)} and {visible(other.name)}"
            raise LogError(f"{path}: {both} belong to the same frame, by {by}")
    in_order = np.array([keys[file] for file in places], np.int64)
    nameless, images = len(files) - len(places), None if named is None else len(named)
    return LabelFolder(path, tuple(places), in_order, by, limits, nameless, images)


def _keys(
    files: Sequence[Path], settings: MaskSettings, named: Mapping[str, int] | None
) -> tuple[str, dict[Path, int]]:
    """Return what the keys are, and that of each file that has one."""
    if named is not None:
        places = {file: named.get(file.stem, named.get(bare(file))) for file in files}
        return "name", {file: place for file, place in places.items() if place is not None}
    times = {file: time for file in files if (time := time_in(bare(file))) is not None}
    are_times = len(times) == len(files) and all(len(bare(file)) > SHORT for file in files)
    if settings.pair == "number" or (settings.pair is None and not are_times):
        return "number", {file: _number(file) - settings.first for file in files}
    for file in files:
        if file not in times:
            raise LogError(f"{file}: its name is no time by which to find its frame")
    return "stamp", times


def _number(file: Path) -> int:
    found = _LAST_NUMBER.search(bare(file))
    if found is None or len(found[1]) > _DIGITS:
        raise LogError(f"{file}: its name has no number by which to find its frame")
    return int(found[1])


def _places(folder: Path) -> dict[str, int]:
    """Return the place of each image of a folder by its name, without its ending."""
    images, _ = ordered(listed(folder, IMAGES))
    names = [image.stem for image in images]
    if len(set(names)) < len(names):
        raise LogError(f"{folder}: two of its images have the same name")
    return {name: place for place, name in enumerate(names)}


def _content(file: Path) -> bytes:
    check_input(file)
    return file.read_bytes()


def npy_picture(data: bytes, limits: Limits) -> RawPicture:
    """Return the ``(H, W)`` array of an NPY file as a picture of one channel.

    Truth values and whole numbers keep their values, numbers with a fraction become float32.
    Nothing in the file is run: an array of objects is refused by its head.

    Raises
    ------
    BadMessage
        If it is no NPY file, is cut off, or holds something else.
    ImageError
        If it is larger than the limits allow.
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
