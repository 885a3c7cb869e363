"""Labels beside the log: a folder of images or NPY files, or files of an annotation tool."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import ParseError, XMLParser, fromstring

import numpy as np

from roadeval.errors import RoadevalError
from roadeval.images.formats import ImageError, Limits, Size
from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.files import IMAGES, first_names, list_files, prefer_ids
from roadeval.logs.messages.pictures import CompressedPicture, Picture, RawPicture
from roadeval.logs.messages.pixels import ROUNDING
from roadeval.logs.settings import AUDIT, MaskSettings
from roadeval.logs.truth import formats
from roadeval.logs.truth.named_labels import LabelSet, NamedLabel
from roadeval.logs.truth.picks import LABELS, PICK, PROPOSALS
from roadeval.logs.truth.shapes import ClassRoles, DrawnLabel, LabelFormat, settle_shapes
from roadeval.runtime.discovery import collect, installed
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import check_input, reading

GREATEST: Final = 256 << 20
"""Greatest number of bytes of a file of labels."""
VALUES: Final = 20_000_000
"""Greatest number of values in it."""
_BAD_FORMAT: Final = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)
"""Exceptions that a reader raises if a file breaks the rules of its format."""
_UNREADABLE: Final = (*_BAD_FORMAT, LogError, BadMessage, ImageError)


def labels_in(path: Path, size: Size | None, settings: MaskSettings | None = None) -> LabelSet:
    """List the labels in a folder or a file; of a pick or an audit the labels in its subfolder.

    Files of an annotation tool come before images, which may be the annotated ones. If the folder
    itself has no labels, the folders below it are searched. ``size`` is the width and height of the
    log's images, if known: some formats have shares of it. The settings decide which shapes are on
    top, and which may be left out. A `LogError` if there is no label, or a file cannot be read.
    """
    if any((path / name).is_file() for name in (PICK, AUDIT)):
        path /= LABELS
        if path.is_dir() and not any(path.iterdir()):
            remedy = f"correct those in {PROPOSALS}, and put the results into {LABELS}"
            raise LogError("no label in it yet", where=path, remedy=remedy)
    if path.is_file() and path.suffix.lower() not in _formats():
        names = sorted({format_.name for formats in _formats().values() for format_ in formats})
        remedy = f"give a folder of images, or a file of {', '.join(names)}"
        raise LogError("no file of labels", where=path, remedy=remedy)
    endings = IMAGES | {NPY} | _formats().keys()
    files = [path] if path.is_file() else list_files(path, endings, below=True)
    problems: list[LogError] = []
    for some_files in ([file for file in files if path in (file, file.parent)], files):
        labels = _find_labels(some_files, size, settings or MaskSettings(), problems)
        if labels is not None:
            return labels
    raise next(iter(problems), LogError("no label in it that roadeval can read", where=path))


def _find_labels(
    files: Sequence[Path], size: Size | None, settings: MaskSettings, problems: list[LogError]
) -> LabelSet | None:
    """Return the labels in some files; None if there are none. Adds to the ``problems``."""
    images = [file for file in files if file.suffix.lower() in IMAGES | {NPY}]
    labels = prefer_ids(images)
    # Cityscapes' images of ids are made from its polygons, which are then left out.
    for ending, format_list in _formats().items() if labels is images else ():
        of_ending = [file for file in files if file.suffix.lower() == ending]
        filled = (file for file in of_ending if file.is_file() and file.stat().st_size)
        for file in islice(filled, 8):
            try:
                content = _parse(file)
            except LogError as error:
                problems.append(error)
                continue
            for format_ in format_list:
                with suppress(*_BAD_FORMAT):
                    if format_.holds(file, content):
                        return _read_drawn(of_ending, {file: content}, format_, size, settings)
            names = " or ".join(format_.name for format_ in format_list)
            problems.append(LogError(f"not labels of {names}", where=file))
    return LabelSet(tuple(map(file_label, labels))) if labels else None


@cache
def _formats() -> dict[str, list[LabelFormat]]:
    """Return the label formats by the endings of their files, other packages' formats last."""
    by_ending: dict[str, list[LabelFormat]] = {}
    for format_ in chain(
        collect(formats, "FORMAT"), installed("label_formats", LabelFormat, LogError)
    ):
        by_ending.setdefault(format_.ending, []).append(format_)
    return by_ending


def _parse(file: Path) -> Any:
    """Parse a file by its ending; a `LogError` if it is damaged, or beyond a limit."""
    try:
        with reading(file, LogError):
            content = read_bounded(file, GREATEST)
        match file.suffix.lower():
            case ".json":
                return read_json(content, VALUES, shown=False, most=GREATEST)
            case ".xml":
                # An encoding with 16 bits a letter, for example, could hide these words.
                if any(word in content for word in (b"<!DOCTYPE", b"<!ENTITY", b"\0")):
                    raise ValueError("it defines entities, or is not in UTF-8")
                return fromstring(content, XMLParser(encoding="utf-8"))
            case _:
                return content.decode("utf-8-sig")  # a byte order mark may come first
    except (ValueError, ParseError) as error:
        reason = str(error)
        if isinstance(error, ParseError):
            line, column = error.position
            reason = f"it is not XML, or ends early (line {line}, column {column + 1})"
        elif isinstance(error, UnicodeDecodeError):
            reason = "it is not in UTF-8"
        raise LogError(f"cannot be read as labels: {reason}", where=file) from error


def _read_drawn(
    files: Sequence[Path],
    parsed: Mapping[Path, Any],
    format_: LabelFormat,
    size: Size | None,
    settings: MaskSettings,
) -> LabelSet:
    """Read the files of a format, some of them parsed already; a `LogError` without any label."""
    drawings, broken, others = _read_images(files, parsed, format_, size)
    notes = []
    lost = len(broken)
    labelled = [drawing for drawing in drawings if drawing.shapes]
    if others:
        notes.append(f"{first_names(others)}: of another format than the other labels, not read")
    if without := len(drawings) - len(labelled):
        notes.append(
            f"{without} of {len(drawings)} images have no shape, and count as not labelled"
        )
    occurring = Counter(sorted(name for drawing in labelled for name in drawing.classes))
    labels = settings.labels.with_values(format_.name, classes=occurring)
    road = labels.road or (tuple(occurring) if len(occurring) == 1 else ())
    ignored = {*map(str, labels.ignore)}
    roles = ClassRoles({*map(str, road)}, ignored, settings.skip_roadless)
    labelled = settle_shapes(labelled, roles, broken, notes)
    if not labelled:
        image, problem = next(iter(broken.items()), (files[0], f"{format_.name} without a shape"))
        where = image if str(files[0]) == str(image) else f"{files[0]}: {image}"
        raise LogError(problem, where=where)
    classes = {name: value for value, name in enumerate(occurring, 1)}

    def picture(drawing: DrawnLabel, _content: bytes, limits: Limits) -> Picture:
        """Return the values of a drawing's classes, ``(H, W)`` uint16, as a picture."""
        try:
            pixels = drawing.pixels(classes, limits)
        except _BAD_FORMAT as error:
            raise BadMessage(_in_words(error, format_)) from error
        height, width = pixels.shape
        data = pixels.astype("<u2").tobytes()
        return RawPicture(0, width, height, "mono16", 0, big_endian=False, data=data)

    drawn = [NamedLabel(Path(d.image), d.content, partial(picture, d)) for d in labelled]
    drawn += [
        NamedLabel(Path(name), bytes, partial(_raise_problem, problem))
        for name, problem in broken.items()
    ]
    return LabelSet(drawn, classes, occurring, lost, tuple(notes))


def _read_images(
    files: Sequence[Path], parsed: Mapping[Path, Any], format_: LabelFormat, size: Size | None
) -> tuple[list[DrawnLabel], dict[str, str], list[str]]:
    """Return the images in some files, the problems of broken ones, and files of other formats.

    If each file has one image, a damaged file is a broken image; else it is a `LogError`.
    """
    drawings, broken, others = list[DrawnLabel](), dict[str, str](), list[str]()
    damaged, image_counts = dict[Path, str](), Counter[Path]()
    for file in files:
        try:
            content = parsed[file] if file in parsed else _parse(file)
            if not format_.holds(file, content):
                others.append(file.name)
                continue
            for drawing in format_.read(file, content, size):
                image_counts[file] += 1
                try:
                    drawings.append(drawing.complete(size))
                except _UNREADABLE as error:
                    broken[drawing.image] = _in_words(error, format_)
        except _UNREADABLE as error:
            damaged[file] = _in_words(error, format_)
    for file, problem in damaged.items():
        if file in image_counts or max(image_counts.values(), default=0) > 1:
            raise LogError(problem, where=file)
        broken[str(file)] = problem
    return drawings, broken, others


def _in_words(error: Exception, format_: LabelFormat) -> str:
    """Return the problem of a file, or of the label of an image."""
    if isinstance(error, RoadevalError):
        return error.reason
    lacking = f" (it has no {error})" if isinstance(error, KeyError) else ""
    return f"an annotation is not as {format_.name} writes it{lacking}"


def _raise_problem(problem: str, *_: Any) -> Picture:
    raise BadMessage(problem)


NPY: Final = ".npy"


def file_label(file: Path) -> NamedLabel:
    """Return the label of an image or NPY file."""

    def content() -> bytes:
        check_input(file)
        return file.read_bytes()

    ending = file.suffix.lower()
    image = partial(CompressedPicture, 0, ending[1:])
    return NamedLabel(file, content, npy_picture if ending == NPY else lambda data, _: image(data))


def npy_picture(data: bytes, limits: Limits) -> RawPicture:
    """Return the ``(H, W)`` array of an NPY file as a picture of one channel.

    Truth values and whole numbers keep their values, numbers with a fraction become float32. No
    code in the file runs: an array of objects is refused. A `BadMessage` if it is not an NPY file,
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
    kind, greatest = array.dtype.kind, np.iinfo(np.uint16).max
    with np.errstate(invalid="ignore"):
        fits = np.isfinite(array) & (array >= -ROUNDING) if kind == "f" else array <= greatest
    if wrong := array[~fits].tolist():
        what = "a class nor a confidence" if kind == "f" else "at most 65535 nor a fraction"
        raise BadMessage(f"it holds {wrong[0]}, which is neither {what}")
    if kind == "f":
        encoding, samples = "32FC1", np.maximum(array, 0).astype("<f4")
    elif kind == "i" and (array < 0).any():
        encoding, samples = "32SC1", np.maximum(array, np.iinfo(np.int32).min).astype("<i4")
    elif array.dtype.itemsize == 1:
        encoding, samples = "mono8", array.astype("u1")
    else:
        encoding, samples = "mono16", array.astype("<u2")
    return RawPicture(0, width, height, encoding, 0, big_endian=False, data=samples.tobytes())
