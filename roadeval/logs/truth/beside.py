"""Labels beside the log: a folder of images or NPY files, or files of an annotation tool."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from functools import cache, partial
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import ParseError, XMLParser, fromstring

import numpy as np
import numpy.typing as npt

from roadeval.images import ImageError, Limits
from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.files import IMAGES, listed, of_ids, some
from roadeval.logs.messages.pictures import CompressedPicture, Picture, RawPicture
from roadeval.logs.truth import formats
from roadeval.logs.truth.drawn import Drawing, LabelFormat, Size
from roadeval.logs.truth.pairing import LabelSet, NamedLabel
from roadeval.logs.truth.picks import LABELS, PICK
from roadeval.runtime.discovery import found_in
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import check_input

GREATEST: Final = 256 << 20
"""Bytes of a file of labels."""
VALUES: Final = 20_000_000
"""Numbers and texts in it."""
_TRIED: Final = 8
"""Files of an ending, of a folder, that are tried for a format."""
_NOT_SO: Final = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)
"""What a reader raises for a file that is not as its format asks."""


def labels_in(path: Path, size: Size | None) -> LabelSet:
    """List the labels in a folder or a file; of picked frames those in their folder of labels.

    In a folder, files of an annotation tool come before images: these may be the ones that were
    annotated. A folder without any of both, or with lists of names alone, is searched with all
    below it. ``size`` is the width and height of the log's images, if known: some formats have
    shares of it. A `LogError` if there is no label, or the file of labels cannot be read.
    """
    if (path / PICK).is_file():
        path /= LABELS
    if path.is_file() and path.suffix.lower() not in _readers():
        known = ", ".join(sorted({each.name for own in _readers().values() for each in own}))
        raise LogError(f"{path}: no file of labels; known are folders of images, and {known}")
    endings = IMAGES | {NPY} | _readers().keys()
    files = [path] if path.is_file() else listed(path, endings, below=True)
    own = [file for file in files if path in (file, file.parent)]
    found = _labels_of(own, path, size) or _labels_of(files, path, size)
    if found is None:
        raise LogError(f"{path}: no label in it that roadeval can read")
    return found


def _labels_of(files: Sequence[Path], path: Path, size: Size | None) -> LabelSet | None:
    """Return the labels that some files hold, of a folder or alone; None if they hold none."""
    for ending in _readers():
        own = [file for file in files if file.suffix.lower() == ending]
        filled = (file for file in own if file.is_file() and file.stat().st_size)
        for file in islice(filled, _TRIED):
            try:
                format_ = _format_of(file)
            except LogError:
                if path.is_file():
                    raise
            else:
                return _drawn(own, format_, size)
    images = [file for file in files if file.suffix.lower() in IMAGES | {NPY}]
    labels = tuple(map(file_label, of_ids(images)))
    return LabelSet(labels) if labels else None


@cache
def _readers() -> dict[str, list[LabelFormat]]:
    """Return the formats by the endings of their files."""
    found: dict[str, list[LabelFormat]] = {}
    for each in chain(*found_in(formats, "FORMATS")):
        found.setdefault(each.ending, []).append(each)
    return found


def _format_of(file: Path) -> LabelFormat:
    """Return the format of a file; a `LogError` if it is of no known one."""
    content, known = _parsed(file), _readers()[file.suffix.lower()]
    with suppress(*_NOT_SO):
        for each in known:
            if each.holds(file, content):
                return each
    raise LogError(f"{file}: not labels of {' or '.join(each.name for each in known)}")


def _parsed(file: Path) -> Any:
    """Parse a file by its ending; a `LogError` if it is damaged, or beyond a limit."""
    try:
        content = read_bounded(file, GREATEST)
        match file.suffix.lower():
            case ".json":
                return read_json(content, VALUES, shown=False, most=GREATEST)
            case ".xml":
                # Another encoding, 16 bits a letter among them, could hide these words.
                if any(word in content for word in (b"<!DOCTYPE", b"<!ENTITY", b"\0")):
                    raise ValueError("it defines entities, or is not in UTF-8")
                return fromstring(content, XMLParser(encoding="utf-8"))
            case _:
                return content.decode()
    except OSError as error:
        raise LogError(f"{file}: {error.strerror}") from error
    except (ValueError, ParseError) as error:
        raise LogError(f"{file}: cannot be read as labels: {error}") from error


def _drawn(files: Sequence[Path], format_: LabelFormat, size: Size | None) -> LabelSet:
    """Read all files of a format. One of several that cannot be read is an unreadable label."""
    drawn: list[Drawing] = []
    problems: dict[Path, str] = {}
    others: list[str] = []
    for file in files:
        try:
            content = _parsed(file)
            if format_.holds(file, content):
                drawn += format_.read(file, content, size)
            else:
                others.append(file.name)
        except (LogError, ImageError) as error:
            problems[file] = str(error).removeprefix(f"{file}: ")
        except _NOT_SO as error:
            problems[file] = f"not as {format_.name} files are: {type(error).__name__} {error}"
    labelled = [each for each in drawn if each.shapes]
    if not labelled:
        file, problem = next(iter(problems.items()), (files[0], f"{format_.name} without a shape"))
        raise LogError(f"{file}: {problem}")
    found = Counter(sorted(name for each in labelled for name in each.classes))
    classes = {name: value for value, name in enumerate(found, 1)}
    broken = [NamedLabel(each, bytes, partial(_raise, why)) for each, why in problems.items()]
    notes = []
    if others:
        notes.append(f"{some(others)}: of another format than the other labels, not read")
    if bare := len(drawn) - len(labelled):
        notes.append(f"{bare} of {len(drawn)} images have no shape, and count as not labelled")
    labels = [*(_label(each, classes) for each in labelled), *broken]
    return LabelSet(labels, classes, occurring=found, notes=tuple(notes))


def _raise(problem: str, *_: Any) -> Picture:
    raise BadMessage(problem)


def _label(drawn: Drawing, classes: dict[str, int]) -> NamedLabel:
    def picture(_content: bytes, limits: Limits) -> Picture:
        try:
            pixels = drawn.pixels(classes, limits)
        except _NOT_SO as error:
            raise BadMessage(str(error)) from error
        height, width = pixels.shape
        data = pixels.astype("<u2").tobytes()
        return RawPicture(0, width, height, "mono16", 0, big_endian=False, data=data)

    return NamedLabel(Path(drawn.image), drawn.content, picture)


NPY: Final = ".npy"


def file_label(file: Path) -> NamedLabel:
    """Return the label of an image or NPY file."""
    ending = file.suffix.lower()

    def picture(data: bytes, limits: Limits) -> Picture:
        return (
            npy_picture(data, limits) if ending == NPY else CompressedPicture(0, ending[1:], data)
        )

    return NamedLabel(file, partial(_content, file), picture)


def _content(file: Path) -> bytes:
    check_input(file)
    return file.read_bytes()


def npy_picture(data: bytes, limits: Limits) -> RawPicture:
    """Return the ``(H, W)`` array of an NPY file as a picture of one channel.

    Truth values and whole numbers keep their values, numbers with a fraction become float32.
    Nothing in the file is run: an array of objects is refused. A `BadMessage` if it is no NPY file,
    is cut off, or holds something else. An `ImageError` if it is larger than the limits allow.
    """
    try:
        array = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except (ValueError, TypeError, SyntaxError, EOFError, RecursionError, MemoryError) as error:
        raise BadMessage("no NPY file of numbers, or a damaged one") from error
    if array.ndim != 2 or array.dtype.kind not in "buif":
        what = f"an array of {array.dtype} of shape {array.shape}"
        raise BadMessage(f"{what}, not of numbers, rows by columns")
    height, width = array.shape
    limits.check(width, height)
    encoding, samples = _samples(array)
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
