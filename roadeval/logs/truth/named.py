"""Labels beside the log that find their frames by their names, whatever their format."""

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

from roadeval.images import ImageError, Limits
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.files import IMAGES, bare, images_of, listed, ordered, some, time_in
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.settings import Color, LabelPlace
from roadeval.runtime.text import visible

_LAST_NUMBER: Final = re.compile(r"(\d+)\D*$")
SHORT: Final = 10
"""Digits of what may be a time in seconds, or a frame's number with zeros before it."""
_DIGITS: Final = 18
"""Most digits of a number that 64 bits hold."""


@dataclass(frozen=True, slots=True)
class NamedLabel:
    """One label beside the log. All that a label format has to give is a list of them."""

    path: Path
    """The file that it is named after, whether it is there or not; messages show it."""
    content: Callable[[], bytes]
    """Read what the label is made of; an OSError if that fails."""
    picture: Callable[[bytes, Limits], Picture]
    """Return the picture of that content; a `BadMessage` or `ImageError` if there is none."""


@dataclass(frozen=True, slots=True)
class LabelSet:
    """The labels of a folder or a file, and the names of their classes."""

    labels: Sequence[NamedLabel]
    classes: Mapping[str, int] = field(default_factory=dict)
    """Values of the classes by their names, where the format has names."""
    colours: Mapping[str, Color] = field(default_factory=dict)
    """Colours of the classes by their names, where images have such a list."""
    occurring: Mapping[str, int] = field(default_factory=dict)
    """In how many labels each class occurs, if that is known without decoding them."""
    notes: tuple[str, ...] = ()
    """Warnings about the labels, a sentence each."""


@dataclass(frozen=True, eq=False)
class NamedLabels:
    """Labels in the order of their keys: the number, or the stamp, of each one's frame."""

    name: str
    """The folder or file, for messages."""
    labels: tuple[NamedLabel, ...]
    origin: LabelSet
    """Where they come from, with the names of their classes."""
    log_times: npt.NDArray[np.int64]
    """``(n,)``: the keys, rising."""
    by: str
    """``number``, ``stamp`` or ``name``: where the keys come from."""
    limits: Limits
    """On the images."""
    nameless: int = 0
    """Further labels, whose name no image has."""
    images: int | None = None
    """How many images the folder holds whose names they have; None where names mean nothing."""

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def sure(self) -> int:
        """How many of them certainly have their key: all."""
        return len(self.labels)

    def stamp(self, position: int) -> int:
        """Return the key of a label."""
        return int(self.log_times[position])

    def picture(self, position: int) -> Picture:
        """Read a label; a `FrameError` if that fails."""
        label = self.labels[position]
        try:
            return label.picture(label.content(), self.limits)
        except OSError as error:
            raise FrameError(f"{self.place(position)}: {error.strerror}") from error
        except (BadMessage, ImageError) as error:
            raise FrameError(f"{self.place(position)}: {error}") from error

    def place(self, position: int) -> str:
        """Return a label's path, for messages to people."""
        return visible(str(self.labels[position].path))

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all keys and labels, in hexadecimal; a `LogError` if one cannot be read."""
        digest = hashlib.sha256()
        for key, label in zip(self.log_times.tolist(), self.labels, strict=True):
            try:
                content = label.content()
            except OSError as error:
                raise LogError(f"{label.path}: {error.strerror}") from error
            digest.update(f"{key} {hashlib.sha256(content).hexdigest()}\n".encode())
        return digest.hexdigest()


def with_keys(origin: LabelSet, name: str, settings: LabelPlace, limits: Limits) -> NamedLabels:
    """Find the key of each label by its name, as the settings ask.

    A `LogError` if a name has no key, or two labels have the same.
    """
    labels = origin.labels
    named = None if settings.images is None else _images(Path(settings.images))
    by, keys = _keys([label.path for label in labels], settings, named)
    if named is not None and not keys:
        raise LogError(
            f"{name}: none of them has the name of an image in {settings.images}: theirs are "
            f"{some([label.path for label in labels])}, the images' {some(named)}; without "
            "`truth.images` numbers or stamps pair them"
        )
    found = sorted((label for label in labels if label.path in keys), key=lambda x: keys[x.path])
    for one, other in pairwise(label.path for label in found):
        if keys[one] == keys[other]:
            first, second = (one, other) if one.name == other.name else (one.name, other.name)
            both = f"{visible(str(first))} and {visible(str(second))}"
            raise LogError(f"{name}: {both} belong to the same frame, by {by}")
    in_order = np.array([keys[label.path] for label in found], np.int64)
    nameless, images = len(labels) - len(found), None if named is None else len(named)
    return NamedLabels(visible(name), tuple(found), origin, in_order, by, limits, nameless, images)


def _keys(
    files: Sequence[Path], settings: LabelPlace, named: Sequence[Path] | None
) -> tuple[str, dict[Path, int]]:
    """Return what the keys are, and that of each file that has one."""
    if named is not None:
        places = {image: place for place, image in enumerate(named)}
        return "name", {file: places[image] for file, image in images_of(files, named).items()}
    times = {file: time for file in files if (time := time_in(bare(file))) is not None}
    are_times = len(times) == len(files) and all(len(bare(file)) > SHORT for file in files)
    if settings.pair == "number" or (settings.pair is None and not are_times):
        return "number", {file: _number(file) - settings.first for file in files}
    for file in files:
        if file not in times:
            raise LogError(f"{file}: its name is not a time, so its frame cannot be found")
    return "stamp", times


def _number(file: Path) -> int:
    found = _LAST_NUMBER.search(bare(file))
    if found is None or len(found[1]) > _DIGITS:
        raise LogError(f"{file}: its name has no number: pair by names, with `truth.images`")
    return int(found[1])


def _images(folder: Path) -> list[Path]:
    """Return the images of a folder in the order in which `pack` logs them."""
    images, _ = ordered(listed(folder, IMAGES))
    if len({image.stem for image in images}) < len(images):
        raise LogError(f"{folder}: two of its images have the same name")
    return images
