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

from roadeval.images.formats import ImageError, Limits
from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.files import IMAGES, listed, of_ids, some
from roadeval.logs.messages.pictures import CompressedPicture, Picture, RawPicture
from roadeval.logs.settings import MaskSettings
from roadeval.logs.truth import formats
from roadeval.logs.truth.drawn import Drawing, LabelFormat, Meant, Size, settled
from roadeval.logs.truth.names import LabelSet, NamedLabel
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
_WRONG: Final = (*_NOT_SO, LogError, BadMessage, ImageError)


def labels_in(path: Path, size: Size | None, asked: MaskSettings | None = None) -> LabelSet:
    """List the labels in a folder or a file; of picked frames those in their folder of labels.

    In a folder, files of an annotation tool come before images: these may be the ones that were
    annotated. A folder without any of both, or with lists of names alone, is searched with all
    below it. ``size`` is the width and height of the log's images, if known: some formats have
    shares of it. What drawn shapes mean decides which is on top, and what can be left out. A
    `LogError` if there is no label, or the file of labels cannot be read.
    """
    if (path / PICK).is_file():
        path /= LABELS
    if path.is_file() and path.suffix.lower() not in _readers():
        known = ", ".join(sorted({each.name for own in _readers().values() for each in own}))
        raise LogError(f"{path}: no file of labels; known are folders of images, and {known}")
    endings = IMAGES | {NPY} | _readers().keys()
    files = [path] if path.is_file() else listed(path, endings, below=True)
    own = [file for file in files if path in (file, file.parent)]
    problems: list[LogError] = []
    for some_files in (own, files):
        labels = _labels_of(some_files, size, asked or MaskSettings(), problems)
        if labels is not None:
            return labels
    raise next(iter(problems), LogError(f"{path}: no label in it that roadeval can read"))


def _labels_of(
    files: Sequence[Path], size: Size | None, asked: MaskSettings, problems: list[LogError]
) -> LabelSet | None:
    """Return the labels that some files hold; None if they hold none, with the problems of some."""
    images = [file for file in files if file.suffix.lower() in IMAGES | {NPY}]
    with_ids = of_ids(images)
    # Cityscapes has polygons beside the ids that were made of them.
    for ending in _readers() if with_ids is images else ():
        own = [file for file in files if file.suffix.lower() == ending]
        filled = (file for file in own if file.is_file() and file.stat().st_size)
        for file in islice(filled, _TRIED):
            try:
                format_ = _format_of(file)
            except LogError as error:
                problems.append(error)
            else:
                return _drawn(own, format_, size, asked)
    labels = tuple(map(file_label, with_ids))
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
    for each in known:
        with suppress(*_NOT_SO):
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
        raise LogError(f"{file}: cannot be read as labels: {_damage(error)}") from error


def _damage(error: Exception) -> str:
    """Return in words what a parser found."""
    match error:
        case ParseError(position=(line, column)):
            return f"it is no XML, or ends early (line {line}, column {column + 1})"
        case UnicodeDecodeError():
            return "it is not in UTF-8"
    return str(error)


def _drawn(
    files: Sequence[Path], format_: LabelFormat, size: Size | None, asked: MaskSettings
) -> LabelSet:
    """Return the labels of all files of a format; a `LogError` if there is none."""
    drawn, broken, others = _images_in(files, format_, size)
    labelled = [drawing for drawing in drawn if drawing.shapes]
    notes = []
    if others:
        notes.append(f"{some(others)}: of another format than the other labels, not read")
    if bare := len(drawn) - len(labelled):
        notes.append(f"{bare} of {len(drawn)} images have no shape, and count as not labelled")
    occurring = Counter(sorted(name for drawing in labelled for name in drawing.classes))
    road = asked.labels.road or (tuple(occurring) if len(occurring) == 1 else ())
    meant = Meant({*map(str, road)}, {*map(str, asked.labels.ignore)}, asked.skip_roadless)
    labelled = settled(labelled, meant, broken, notes)
    if not labelled:
        image, problem = next(iter(broken.items()), (files[0], f"{format_.name} without a shape"))
        where = "" if str(files[0]) == str(image) else f"{files[0]}: "
        raise LogError(f"{where}{image}: {problem}")
    classes = {name: value for value, name in enumerate(occurring, 1)}
    unread = [NamedLabel(Path(name), bytes, partial(_raise, why)) for name, why in broken.items()]
    labels = [*(_label(drawing, classes, format_) for drawing in labelled), *unread]
    return LabelSet(labels, classes, occurring=occurring, notes=tuple(notes))


def _images_in(
    files: Sequence[Path], format_: LabelFormat, size: Size | None
) -> tuple[list[Drawing], dict[str, str], list[str]]:
    """Return the images in some files, those whose labels cannot be read, and files of others.

    A file that cannot be read is such an image where each file has one. A `LogError` if they have
    several.
    """
    drawn: list[Drawing] = []
    whole, damaged = Counter[Path](), dict[Path, str]()
    broken: dict[str, str] = {}
    others: list[str] = []
    for file in files:
        try:
            content = _parsed(file)
            if not format_.holds(file, content):
                others.append(file.name)
                continue
            for drawing in format_.read(file, content, size):
                whole[file] += 1
                try:
                    drawn.append(drawing.whole(size))
                except _WRONG as error:
                    broken[drawing.image] = _in_words(error, format_)
        except _WRONG as error:
            damaged[file] = _in_words(error, format_).removeprefix(f"{file}: ")
    for file, problem in damaged.items():
        if file in whole or max(whole.values(), default=0) > 1:
            raise LogError(f"{file}: {problem}")
        broken[str(file)] = problem
    return drawn, broken, others


def _in_words(error: Exception, format_: LabelFormat) -> str:
    """Return what is wrong with a file, or with the label of an image."""
    if not isinstance(error, _NOT_SO) or isinstance(error, ImageError):
        return str(error)
    lacking = f" (it has no {error})" if isinstance(error, KeyError) else ""
    return f"an annotation is not as {format_.name} writes it{lacking}"


def _raise(problem: str, *_: Any) -> Picture:
    raise BadMessage(problem)


def _label(drawn: Drawing, classes: dict[str, int], format_: LabelFormat) -> NamedLabel:
    def picture(_content: bytes, limits: Limits) -> Picture:
        try:
            pixels = drawn.pixels(classes, limits)
        except _NOT_SO as error:
            raise BadMessage(_in_words(error, format_)) from error
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
        fits = np.isfinite(pixels) & (pixels >= 0) if is_fraction else pixels <= greatest
        wrong = pixels[~fits]
    if wrong.size and is_fraction:
        raise BadMessage(f"it holds {wrong[0]}, which is neither a class nor a confidence")
    if wrong.size:
        raise BadMessage(f"it holds {wrong[0]}, which is neither at most 65535 nor a fraction")
    if is_fraction:
        return "32FC1", pixels.astype("<f4")
    if pixels.dtype.kind == "i" and (pixels < 0).any():
        return "32SC1", np.maximum(pixels, np.iinfo(np.int32).min).astype("<i4")
    if pixels.dtype.itemsize == 1:
        return "mono8", pixels.astype("u1")
    return "mono16", pixels.astype("<u2")
