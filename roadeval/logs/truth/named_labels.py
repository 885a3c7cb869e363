"""Labels in files beside the log, each paired with a frame by its name.

A name contains the frame's number or its time, or is the name of an image.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.images.formats import ImageError, Limits
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.files import (
    IMAGES,
    NUMBER,
    bare_name,
    first_names,
    images_of,
    list_files,
    match_name,
    order_by_time,
    times_alone,
    times_in,
    without_hashes,
)
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.settings import LabelPlace
from roadeval.runtime.files import reading
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.text import visible

SHORT: Final = 10
"""Digits of a name that may be a time in seconds, or a frame's number with zeros before it."""


@dataclass(frozen=True)
class NamedLabel:
    """One label beside the log."""

    path: Path
    """Its name, for messages; the file need not exist."""
    content: Callable[[], bytes]
    """Read the content of the label; an OSError if that fails."""
    picture: Callable[[bytes, Limits], Picture]
    """Return the picture of that content; a `BadMessage` or `ImageError` if there is none."""


@dataclass(frozen=True)
class LabelSet:
    """The labels of a folder or a file, and the names of their classes."""

    labels: Sequence[NamedLabel]
    classes: Mapping[str, int] = field(default_factory=dict)
    """Values of the classes by their names, if the format has names."""
    occurring: Mapping[str, int] = field(default_factory=dict)
    """Number of labels in which each class occurs, if that is known without decoding them."""
    lost: int = 0
    """Number of unreadable labels, with unknown classes."""
    notes: tuple[str, ...] = ()
    """Warnings about the labels, a sentence each."""


@dataclass(frozen=True, eq=False)
class NamedLabels:
    """Labels in the order of their keys: the number, or the stamp, of each one's frame."""

    name: str
    """The folder or file, for messages."""
    labels: tuple[NamedLabel, ...]
    origin: LabelSet
    """All labels of the folder or file, and their classes."""
    log_times: npt.NDArray[np.int64]
    """``(n,)`` int64: the keys, ascending."""
    by: str
    """The kind of the keys: ``number``, ``stamp`` or ``name``."""
    limits: Limits
    """Limits on the images."""
    first: int = 0
    """The number in the name of the first frame's label."""
    nameless: int = 0
    """Number of further labels with names that no image has."""
    images: int | None = None
    """Number of images in the folder that names are compared with; None without such a folder."""

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def sure(self) -> int:
        """The number of labels with a certain key, which is all of them."""
        return len(self.labels)

    def stamp(self, position: int) -> int:
        """Return the key of a label."""
        return int(self.log_times[position])

    def picture(self, position: int) -> Picture:
        """Read a label; a `FrameError` if that fails."""
        label = self.labels[position]
        try:
            return label.picture(label.content(), self.limits)
        except (OSError, BadMessage, ImageError) as error:
            reason = str(error.strerror) if isinstance(error, OSError) else error.sentence
            raise FrameError(reason, where=self.place(position)) from error

    def place(self, position: int) -> str:
        """Return a label's path, for messages to people."""
        return visible(str(self.labels[position].path))

    @cached_property
    def digest(self) -> str:
        """The SHA-256 of all keys and labels in hexadecimal; a `LogError` if one is unreadable."""
        digest = hashlib.sha256()
        for key, label in zip(self.log_times.tolist(), self.labels, strict=True):
            with reading(label.path, LogError):
                content = label.content()
            digest.update(f"{key} {hashlib.sha256(content).hexdigest()}\n".encode())
        return digest.hexdigest()


def find_keys(
    origin: LabelSet,
    name: str,
    settings: LabelPlace,
    limits: Limits,
    frames: int | None = None,
    *,
    named: Sequence[Path] = (),
) -> NamedLabels:
    """Find the key of each label by its name.

    ``frames`` is the number of frames of the log, if it is certain; ``named`` are the names of its
    images, if it has them, and used if a label has the name of one. A `LogError` if a name has no
    key, two labels have the same, or the digits or the first number are doubtful.
    """
    shown = {label.path: shown_name(label.path, name) for label in origin.labels}
    names = {path: text for path, text in shown.items() if match_name(settings.names, text)}
    if not names:
        problem = f"no label has a name as {settings.names}: {first_names([*shown.values()])}"
        raise LogError(problem, where=name, setting="truth.names")
    images: Sequence[Path] | None = None
    if settings.images is None and settings.pair is None and images_of([*names], named):
        images = named
    elif settings.images is not None:
        folder = Path(settings.images)
        images, _ = order_by_time(list_files(folder, IMAGES))  # the order of `pack`
        if len({image.stem for image in images}) < len(images):
            raise LogError("two of its images have the same name", where=folder)
    by, keys = _keys_of(names, settings, images)
    if images is not None and not keys:
        raise LogError(
            f"no label has the name of an image in {settings.images}: theirs are "
            f"{first_names([*names])}, the images' {first_names(images)}",
            where=name,
            setting="truth.images",
            remedy="without it numbers or stamps pair them",
        )
    labels = [label for label in origin.labels if label.path in keys]
    labels.sort(key=lambda label: keys[label.path])
    for one, other in pairwise(label.path for label in labels):
        if keys[one] == keys[other]:
            first, second = (one, other) if one.name == other.name else (one.name, other.name)
            both = f"{visible(str(first))} and {visible(str(second))}"
            remedy = Sentence("choose one kind by {truth.names}, as *_mask.png or masks/*")
            raise LogError(f"{both} belong to the same frame, by {by}", where=name, remedy=remedy)
    rising = np.array([keys[label.path] for label in labels], np.int64)
    number = settings.first or 0
    if by == "number":
        number = _first_number(rising, frames, name) if settings.first is None else number
        rising -= number
    return NamedLabels(
        visible(name),
        tuple(labels),
        origin,
        rising,
        by,
        limits,
        number,
        nameless=sum(label.path in names for label in origin.labels) - len(labels),
        images=None if images is None else len(images),
    )


def shown_name(file: Path, folder: str) -> str:
    """Return the path of a label's file below the folder of all labels."""
    inside = file.relative_to(folder) if file.is_relative_to(folder) else file
    return inside.as_posix()


def _keys_of(
    files: Mapping[Path, str], settings: LabelPlace, images: Sequence[Path] | None
) -> tuple[str, dict[Path, int]]:
    """Return the kind of the keys, and the key of each file that has one."""
    if images is not None:
        places = {image: place for place, image in enumerate(images)}
        return "name", {file: places[image] for file, image in images_of([*files], images).items()}
    names = [*map(bare_name, files)]
    texts = names if NUMBER in settings.names else times_alone(names)
    times = [] if settings.pair == "number" else times_in(texts)
    are_times = None not in times and all(len(text) > SHORT for text in texts)
    if settings.pair == "number" or (settings.pair is None and not are_times):
        return "number", _numbers_of(files, settings.names)
    keys = {file: time for file, time in zip(files, times, strict=True) if time is not None}
    for file in files:
        if file not in keys:
            raise LogError("its name is not a time, so its frame cannot be found", where=file)
    return "stamp", keys


def _numbers_of(files: Mapping[Path, str], pattern: str) -> dict[Path, int]:
    """Return the number in the name of each file: the group of digits by which the names differ.

    A pattern with `NUMBER` shows its place. A `LogError` if the names differ elsewhere, too.
    """
    first, *_, last = *files, *files
    if NUMBER in pattern:
        digits = (*(match[1] for name in files.values() if (match := match_name(pattern, name))),)
    else:
        parts = [re.split(r"(\d+)", name) for name in without_hashes([*map(bare_name, files)])]
        groups = [*zip(*(part[1::2] for part in parts), strict=False)]
        varied = [group for group in groups if len({text.lstrip("0") for text in group}) > 1]
        digits, *others = varied or groups[-1 if len(files) > 1 else 0 :] or [()]
        texts = zip(files, parts, strict=True)
        odd_one = next((file for file, part in texts if part[::2] != parts[0][::2]), None)
        if others or odd_one:
            raise LogError(
                "the names do not tell which digits are the frame's number",
                where=first_names(sorted({first, odd_one or last})),
                remedy=Sentence(
                    "show them by {truth.names}, as frame_{}_*; or name the folder of the log's "
                    "images by {truth.images}",
                    NUMBER,
                ),
            )
    if not digits or max(map(len, digits)) > 18:  # more do not fit into 64 bits
        remedy = Sentence("pair by names, with {truth.images}")
        raise LogError("its name has no number of a frame", where=first, remedy=remedy)
    return dict(zip(files, map(int, digits), strict=True))


def _first_number(numbers: npt.NDArray[np.int64], frames: int | None, name: str) -> int:
    """Return the number of the first frame, given the numbers of labels in rising order.

    It is certain if a label has the number 0 or the number of frames, or if every frame has a
    label; else a `LogError`.
    """
    low, high = int(numbers[0]), int(numbers[-1])
    if low == 0:
        return 0
    if frames is not None and (high == frames or len(numbers) == frames == high - low + 1):
        return high - frames + 1
    raise LogError(
        f"its labels have the numbers {low} to {high}, which does not tell whether the first "
        "frame is number 0 or 1",
        where=name,
        remedy=Sentence("set {truth.first} to 0 or to 1"),
    )
