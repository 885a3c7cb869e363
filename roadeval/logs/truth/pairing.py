"""Which label belongs to which image: by stamp, frame number, name, or what takes their place.

Labels may be logged long after their images, so log times do not pair them. Stamps are read only
where they are needed: around the stamp that is looked for.
"""

from __future__ import annotations

import hashlib
import re
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from itertools import islice, pairwise, takewhile
from pathlib import Path
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from roadeval.images.formats import ImageError, Limits
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.files import (
    IMAGES,
    NUMBER,
    bare,
    images_of,
    listed,
    matching,
    ordered,
    some,
    time_in,
    without_hashes,
)
from roadeval.logs.messages.pictures import Picture, codec_of
from roadeval.logs.settings import NS, LabelPlace, TopicSettings
from roadeval.logs.topics.reader import UNREADABLE, TopicInfo, TopicReader, median_period
from roadeval.runtime.text import visible

SHORT: Final = 10
"""Digits of what may be a time in seconds, or a frame's number with zeros before it."""
_DIGITS: Final = 18
"""Most digits of a number that 64 bits hold."""


@dataclass(frozen=True)
class NamedLabel:
    """One label beside the log. All that a label format has to give is a list of them."""

    path: Path
    """The file that it is named after, whether it is there or not; messages show it."""
    content: Callable[[], bytes]
    """Read what the label is made of; an OSError if that fails."""
    picture: Callable[[bytes, Limits], Picture]
    """Return the picture of that content; a `BadMessage` or `ImageError` if there is none."""


@dataclass(frozen=True)
class LabelSet:
    """The labels of a folder or a file, and the names of their classes."""

    labels: Sequence[NamedLabel]
    classes: Mapping[str, int] = field(default_factory=dict)
    """Values of the classes by their names, where the format has names."""
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
    first: int = 0
    """The number in the name of the first frame's label."""
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


def with_keys(
    origin: LabelSet, name: str, settings: LabelPlace, limits: Limits, frames: int | None = None
) -> NamedLabels:
    """Find the key of each label by its name, as the settings ask.

    ``frames`` is the number of frames of the log, if no loss leaves it open. A `LogError` if a name
    has no key, two labels have the same, or it is not plain which digits or which first number
    count.
    """
    shown = {label.path: shown_name(label.path, name) for label in origin.labels}
    labels = [label for label in origin.labels if matching(settings.names, shown[label.path])]
    if not labels:
        theirs = some([*shown.values()])
        raise LogError(f"{name}: no label has a name as `truth.names` {settings.names}: {theirs}")
    named = None if settings.images is None else _images(Path(settings.images))
    by, keys = _keys({each.path: shown[each.path] for each in labels}, settings, named)
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
    number = settings.first or 0
    if by == "number":
        number = _first_number(in_order, frames, name) if settings.first is None else number
        in_order -= number
    nameless, images = len(labels) - len(found), None if named is None else len(named)
    place = visible(name), tuple(found), origin, in_order, by
    return NamedLabels(*place, limits, number, nameless, images)


def shown_name(file: Path, folder: str) -> str:
    """Return the name of a label's file as seen from the folder of all."""
    inside = file.relative_to(folder) if file.is_relative_to(folder) else file
    return inside.as_posix()


def _keys(
    files: Mapping[Path, str], settings: LabelPlace, named: Sequence[Path] | None
) -> tuple[str, dict[Path, int]]:
    """Return what the keys are, and that of each file that has one."""
    if named is not None:
        places = {image: place for place, image in enumerate(named)}
        return "name", {file: places[image] for file, image in images_of([*files], named).items()}
    times = {file: time for file in files if (time := time_in(bare(file))) is not None}
    are_times = len(times) == len(files) and all(len(bare(file)) > SHORT for file in files)
    if settings.pair == "number" or (settings.pair is None and not are_times):
        return "number", _numbers(files, settings.names)
    for file in files:
        if file not in times:
            raise LogError(f"{file}: its name is not a time, so its frame cannot be found")
    return "stamp", times


def _numbers(files: Mapping[Path, str], pattern: str) -> dict[Path, int]:
    """Return the number in the name of each file: the group of digits by which the names differ.

    A pattern with `NUMBER` says where it is. A `LogError` if the names differ otherwise, too.
    """
    first, *_, last = *files, *files
    if NUMBER in pattern:
        digits = (*(found[1] for name in files.values() if (found := matching(pattern, name))),)
    else:
        parts = [re.split(r"(\d+)", name) for name in without_hashes([*map(bare, files)])]
        groups = [*zip(*(part[1::2] for part in parts), strict=False)]
        varied = [group for group in groups if len({text.lstrip("0") for text in group}) > 1]
        digits, *others = varied or groups[-1 if len(files) > 1 else 0 :] or [()]
        other = next(
            (f for f, p in zip(files, parts, strict=True) if p[::2] != parts[0][::2]), None
        )
        if others or other:
            raise LogError(
                f"{some(sorted({first, other or last}))}: the names do not tell which digits are "
                f"the frame's number: show them by `truth.names`, as frame_{NUMBER}_*; or name the "
                "folder of the log's images by `truth.images`"
            )
    if max(map(len, digits), default=_DIGITS + 1) > _DIGITS:
        raise LogError(f"{first}: its name has no number: pair by names, with `truth.images`")
    return dict(zip(files, map(int, digits), strict=True))


def _first_number(numbers: npt.NDArray[np.int64], frames: int | None, name: str) -> int:
    """Return the number of the first frame, by the numbers of labels in rising order.

    A label of number 0 tells it, and labels up to as many as there are frames do, and a label for
    every frame. A `LogError` if nothing does.
    """
    low, high = int(numbers[0]), int(numbers[-1])
    if low == 0:
        return 0
    if frames is not None and (high == frames or len(numbers) == frames == high - low + 1):
        return high - frames + 1
    raise LogError(
        f"{name}: its labels have the numbers {low} to {high}, which does not tell whether the "
        "first frame is number 0 or 1: give `truth.first` 0 or `truth.first` 1"
    )


def _images(folder: Path) -> list[Path]:
    """Return the images of a folder in the order in which `pack` logs them."""
    images, _ = ordered(listed(folder, IMAGES))
    if len({image.stem for image in images}) < len(images):
        raise LogError(f"{folder}: two of its images have the same name")
    return images


REACH: Final = 4
"""Messages to look at on either side: topics are logged nearly, not always, in stamp order. Where
the first ones are in order, those within so many frame periods: others cost a chunk each."""
ALONE_NS: Final = 50_000_000
"""Half the period of a camera of 10 Hz."""
CLOCKS_NS: Final = 3_000_000_000
"""Least difference by which two clocks are told: of GPS, TAI and UTC any two lie farther apart."""
LOOKED_AT: Final = 10
"""First images of a log that decide by what labels are paired."""

LabelPictures = TopicReader | NamedLabels
"""Label pictures in the order of their times or numbers."""


class Stamps(Protocol):
    """The stamps of pictures, or numbers in place of stamps; nearly rising."""

    def __len__(self) -> int: ...

    def stamp(self, position: int) -> int:
        """Return nanoseconds, or `UNREADABLE`."""
        ...


class Times:
    """Rising numbers in place of stamps; only the first ``sure`` of them, by default all, count."""

    def __init__(
        self, times: Sequence[int] | npt.NDArray[np.int64], sure: int | None = None
    ) -> None:
        self._times = times
        self._sure = len(times) if sure is None else sure

    def __len__(self) -> int:
        return len(self._times)

    def stamp(self, position: int) -> int:
        """Return the number at a position, or `UNREADABLE`."""
        return int(self._times[position]) if position < self._sure else UNREADABLE


@dataclass(frozen=True, eq=False)
class Later:
    """Stamps to each of which ``offset`` nanoseconds are added."""

    stamps: Stamps
    offset: int

    def __len__(self) -> int:
        return len(self.stamps)

    def stamp(self, position: int) -> int:
        """Return the stamp at a position with the offset, or `UNREADABLE`."""
        stamp = self.stamps.stamp(position)
        return stamp if stamp == UNREADABLE else stamp + self.offset


class Clock(StrEnum):
    """What the images of a log can be paired by."""

    STAMP = "header stamps"
    LOG_TIME = "log times"
    ORDER = "their order"


@dataclass(frozen=True, eq=False)
class Camera:
    """The images that labels are paired with, and the rules for it."""

    images: TopicReader
    topic: TopicInfo
    clock: Clock
    """Header stamps if they differ, else log times, else their order."""
    tolerance_ns: int
    """Largest time between an image and its label."""
    resize_labels: bool
    """Whether labels of another size are scaled to the image's (nearest pixel)."""

    @classmethod
    def of(cls, images: TopicReader, topic: TopicInfo, asked: TopicSettings) -> Camera:
        """Find the rules for a camera; the tolerance defaults to half the frame period."""
        tolerance_ns = tolerance(images, asked.sync_tolerance_ms)
        return cls(images, topic, clock_of(images), tolerance_ns, asked.resize_truth)


def clock_of(reader: TopicReader) -> Clock:
    """Return what differs among the first images of a topic."""
    stamps = (reader.stamp(position) for position in range(len(reader)))
    known = list(islice((stamp for stamp in stamps if stamp != UNREADABLE), LOOKED_AT))
    if len(set(known)) > 1 or (len(known) == 1 and any(known)):
        return Clock.STAMP
    times = reader.log_times[:LOOKED_AT]
    return Clock.LOG_TIME if len(times) <= 1 or times[0] != times[-1] else Clock.ORDER


def tolerance(reader: TopicReader, asked_ms: float | None) -> int:
    """Return the tolerance asked for, else half the frame period, in nanoseconds.

    A single image has no period: its tolerance is `ALONE_NS`.
    """
    if asked_ms is not None:
        return round(asked_ms * 1e6)
    if len(reader) == 1:
        return ALONE_NS
    period = median_period(reader.log_times)
    if period == 0:
        stamps = sorted(reader.stamp(position) for position in range(min(LOOKED_AT, len(reader))))
        known = [stamp for stamp in stamps if stamp != UNREADABLE]
        period = median_period(np.array(known, np.int64))
    return period // 2


@dataclass(frozen=True, eq=False)
class Pairing:
    """How the images and labels of one source are paired.

    Equal stamps are a pair (the k-th image and the k-th label of the same stamp), in whatever order
    they come; otherwise the nearest within the tolerance, if each is the other's nearest.
    """

    images: Stamps
    labels: Stamps
    tolerance: int
    """Largest difference of the stamps of a pair."""
    reach_ns: int | None = None
    """Where both are in order: the first stamp on a side that is farther away ends the search."""
    is_small: bool = False
    """Whether all stamps may be read to find an equal one."""
    unused: int = 0
    """Labels that belong to no frame of the log, as far as that is known beforehand."""
    note: str = ""
    """Its unusual properties, for people."""
    unsure: int = 0
    """Frames without a label because their number is not certain: an unknown number of images, or
    of the other log's labels, is lost before them."""


class Partners:
    """Finds each image's label, at most one; quickest for one image after the other.

    The search for the first one begins at the label position ``near``.
    """

    def __init__(self, pairing: Pairing, near: int = 0) -> None:
        self._pairing = pairing
        self.near = min(near, max(len(pairing.labels) - 1, 0))
        """Position of a label near the last image's stamp."""
        self.used: set[int] = set()
        """Positions of the labels that were found."""
        self.missed = 0
        """Images that have no label because another one is nearer to it."""

    def of(self, image: int) -> int | None:
        """Return the position of the label of an image; None if it has none."""
        found = self._label(image)
        self.used |= set() if found is None else {found}
        return found

    def _label(self, image: int) -> int | None:
        images, labels, reach = self._pairing.images, self._pairing.labels, self._pairing.reach_ns
        stamp = images.stamp(image)
        if stamp == UNREADABLE or not len(labels):
            return None
        middle = _seek(labels, stamp, _expected(labels, stamp, self.near))
        exact = next(_equal(labels, stamp, middle, reach), None)
        if self._pairing.is_small and (exact is None or exact in self.used):
            # It may lie anywhere.
            same, ranks = self._labels_of.get(stamp, []), self._images_of.get(stamp, [])
            if same:
                return dict(zip(ranks, same, strict=False)).get(image)
        elif exact is None:
            exact = next(_equal(labels, stamp, min(self.near + 1, len(labels) - 1), reach), None)
        if exact is not None:
            self.near = exact
            before = _equal(images, stamp, image, reach, image)
            rank = sum(1 for _ in before)
            return next(islice(_equal(labels, stamp, exact, reach), rank, None), None)
        label = self.near = _closest(labels, stamp, middle, reach)
        theirs = labels.stamp(label)
        if theirs == UNREADABLE or abs(theirs - stamp) > self._pairing.tolerance:
            return None
        if _closest(images, theirs, _seek(images, theirs, image), reach) != image:
            self.missed += 1
            return None
        return label

    @cached_property
    def _labels_of(self) -> dict[int, list[int]]:
        return _places(self._pairing.labels)

    @cached_property
    def _images_of(self) -> dict[int, list[int]]:
        return _places(self._pairing.images)

    def unpaired(self, *, of_all: bool) -> tuple[int, int]:
        """Count the labels that no image found: of all, or of those between labels that one did.

        Also return the nanoseconds between the first of them and the nearest image.
        """
        images, labels = self._pairing.images, self._pairing.labels
        ends = (
            (0, len(labels)) if of_all else (min(self.used, default=0), max(self.used, default=0))
        )
        stamps = [labels.stamp(place) for place in range(*ends) if place not in self.used]
        stamps = [stamp for stamp in stamps if stamp != UNREADABLE]
        if not stamps:
            return 0, 0
        middle = _seek(images, stamps[0], 0)
        nearest = _closest(images, stamps[0], middle, self._pairing.reach_ns)
        return len(stamps), abs(images.stamp(nearest) - stamps[0])


def _places(stamps: Stamps) -> dict[int, list[int]]:
    """Return the positions of each stamp."""
    places: dict[int, list[int]] = {}
    for place in range(len(stamps)):
        places.setdefault(stamps.stamp(place), []).append(place)
    return places


def frames_of(pairing: Pairing, begin: int = 0, end: int | None = None) -> Iterator[int]:
    """Yield the position of each label's image, in the order of the labels from ``begin`` on."""
    images, labels = pairing.images, pairing.labels
    forth, back = Partners(pairing), Partners(replace(pairing, images=labels, labels=images))
    for label in range(len(labels))[begin:end]:
        image = back.of(label)
        # Where many stamps are equal or out of order, two labels may find the same image.
        if image is not None and forth.of(image) == label:
            yield image


def _closest(stamps: Stamps, stamp: int, middle: int, reach: int | None) -> int:
    """Return the position of the nearest stamp around a position (the first of equals)."""

    def distance(position: int) -> int:
        theirs = stamps.stamp(position)
        return 2**64 if theirs == UNREADABLE else abs(theirs - stamp)

    around = _around(stamps, stamp, middle, reach)
    return min(around, key=lambda position: (distance(position), position))


def _equal(
    stamps: Stamps, stamp: int, middle: int, reach: int | None, end: int | None = None
) -> Iterator[int]:
    """Yield the positions with a stamp around a position, before ``end`` if it is given.

    Where the stamp comes more often in a row than is looked at, the row is followed to its ends.
    """

    def is_it(place: int) -> bool:
        return stamps.stamp(place) == stamp

    stop, last = len(stamps) if end is None else end, middle
    for number, last in enumerate(_around(stamps, stamp, middle, None if reach is None else 0)):
        if last >= stop:
            return
        if is_it(last):
            if not number:
                yield from reversed([*takewhile(is_it, range(last - 1, -1, -1))])
            yield last
    if last < stop and is_it(last):
        yield from takewhile(is_it, range(last + 1, stop))


def _around(stamps: Stamps, stamp: int, middle: int, reach: int | None) -> Iterator[int]:
    """Yield the positions around one, in order, to the first stamp on a side beyond the reach."""
    first, last = max(middle - REACH, 0), min(middle + REACH, len(stamps) - 1)
    if reach is not None:
        left = range(middle - 1, first, -1)
        beyond = (at for at in left if UNREADABLE < stamps.stamp(at) < stamp - reach)
        first = next(beyond, first)
    for place in range(first, last + 1):
        yield place
        if reach is not None and place >= middle and stamps.stamp(place) > stamp + reach:
            return


def _expected(stamps: Stamps, stamp: int, near: int) -> int:
    """Return where a stamp lies if log times are as far from stamps as at the position ``near``."""
    if not isinstance(stamps, TopicReader) or (known := stamps.stamp(near)) == UNREADABLE:
        return near
    logged = int(stamps.log_times[near]) - known + stamp
    place = np.searchsorted(stamps.log_times, min(max(logged, -(2**63)), 2**63 - 1))
    return min(int(place), len(stamps) - 1)


def _seek(stamps: Stamps, stamp: int, hint: int) -> int:
    """Return the first position at or after a stamp: ever longer steps from the hint, then halving.

    A stamp that cannot be read counts as the next one that can.
    """

    def at(position: int) -> int:
        for candidate in range(position, min(position + REACH, len(stamps))):
            if (found := stamps.stamp(candidate)) != UNREADABLE:
                return found
        return UNREADABLE

    low, high, step = hint, hint, 1
    while low > 0 and at(low) >= stamp:
        low, high, step = max(low - step, 0), low, step * 2
    step = 1
    while high < len(stamps) and at(high) < stamp:
        low, high, step = high, min(high + step, len(stamps)), step * 2
    return min(bisect_left(range(len(stamps)), stamp, low, high, key=at), len(stamps) - 1)


def by_time(labels: LabelPictures, camera: Camera, offset_ms: float = 0.0) -> Pairing:
    """Pair by stamps, by log times, or by order where the log has no times at all.

    The offset is added to the labels' times. Order means something only if there is a label for
    each image.
    """
    images, clock, offset = camera.images, camera.clock, round(offset_ms * 1e6)
    note = ""
    if clock is Clock.STAMP and isinstance(labels, TopicReader):
        check_clocks(images, labels, offset)
    elif clock is Clock.STAMP and isinstance(labels, NamedLabels) and len(labels):
        clock, note = _clock_of_names(images, labels, camera.tolerance_ns, offset)
    if clock is Clock.STAMP:
        period = median_period(images.log_times)
        in_order = period > 0 and _rise(images) and _rise(labels)
        is_small = images.is_small and (isinstance(labels, NamedLabels) or labels.is_small)
        reach = max(REACH * period, camera.tolerance_ns) if in_order and not is_small else None
        stamps = Later(labels, offset) if offset else labels
        return Pairing(images, stamps, camera.tolerance_ns, reach, is_small, note=note)
    if clock is Clock.LOG_TIME:
        times = Times(images.log_times), Times(labels.log_times + offset)
        return Pairing(*times, camera.tolerance_ns, note=note)
    count = min(labels.sure, len(labels) if len(images) == len(labels) else 0)
    unsure = len(images) - min(images.sure, labels.sure)
    frames = Times(range(len(images)), images.sure)
    return Pairing(frames, Times(range(count)), camera.tolerance_ns, unsure=unsure)


def check_clocks(images: TopicReader, labels: TopicReader, offset: int) -> None:
    """Refuse, as a `LogError`, labels that another clock has stamped than the images.

    From stamp to log time it is then another time than for the images, and the same at both ends.
    Labels that were only logged late have stamps among the images', or log times behind theirs.
    """
    if not len(labels):
        return
    both = (images, labels)
    ours, theirs = ([reader.stamp(0), reader.stamp(len(reader) - 1)] for reader in both)
    begin, end = (theirs[place] + offset - ours[place] for place in (0, 1))
    logged, last = (int(labels.log_times[at]) - int(images.log_times[at]) for at in (0, -1))
    apart = begin - logged
    if (
        min(*ours, *theirs) <= 0
        or abs(apart) < CLOCKS_NS
        or 4 * abs(end - last - apart) > abs(apart)
    ):
        return
    outside = 2 * (-begin if apart < 0 else end) > abs(apart)
    one_log = labels.channels[0].container in [channel.container for channel in images.channels]
    if outside or (one_log and 2 * max(-logged, last) <= abs(apart)):
        # Labels come some moments after their images.
        whole = round(apart / NS, 0 if abs(apart / NS - round(apart / NS)) < 0.2 else 3)
        side = "before" if whole < 0 else "after"
        raise LogError(
            f"{labels.name}: its stamps are of another clock than those of {images.name}: they lie "
            f"about {abs(whole):g} s {side} them for the same log times; `topics.sync_offset_ms` "
            f"{round(-whole * 1000)} moves the truth's to the images'"
        )


def _clock_of_names(
    images: TopicReader, labels: NamedLabels, most: int, offset: int
) -> tuple[Clock, str]:
    """Return what the times in the labels' names are, and what is said of it.

    Where none is the stamp of an image, they are log times if those are other frames' than the
    stamps nearby, and the labels follow them, or are nearer to them.
    """
    keys, logged = labels.log_times + offset, images.log_times
    keys = keys[np.unique(np.linspace(0, len(keys) - 1, 2 * LOOKED_AT, dtype=int))]
    frames = []
    for key in keys.tolist():
        hint = min(int(np.searchsorted(logged, key)), len(images) - 1)
        middle = _seek(images, key, hint)
        frames.append(
            [_closest(images, key, middle, None), _closest(Times(logged), key, hint, None)]
        )
    by_stamp, by_log = np.array(frames).T
    behind = keys - [images.stamp(frame) for frame in by_stamp.tolist()]
    after = keys - logged[by_log]
    step = next(10**n for n in range(9, 2, -1) if n == 3 or not (keys % 10**n).any())
    if np.median(np.abs(behind)) < step or np.abs([behind, after]).min() > most:
        return Clock.STAMP, ""
    stamped, away = (float(np.median(times)) / 1e6 for times in (behind, after))
    is_nearer = (stamped < 0, abs(stamped)) <= (away < 0, abs(away))
    if np.median(np.abs(after)) >= step and (is_nearer or (by_stamp == by_log).all()):
        return Clock.STAMP, (
            f"no name is the stamp of a frame: by median they lie {stamped:.1f} ms after the "
            "nearest one; if they are of another one, `topics.sync_offset_ms` moves them"
        )
    met = int(np.count_nonzero(np.abs(after) <= most))
    return Clock.LOG_TIME, (
        f"no name is the stamp of a frame: log times pair them, for {met} of the {len(keys)} that "
        f"were looked at lie {away:.1f} ms after a frame's log time, by median"
    )


def _rise(stamps: Stamps) -> bool:
    """Whether the first stamps are in order."""
    first = [stamps.stamp(place) for place in range(min(LOOKED_AT, len(stamps)))]
    return all(one < other for one, other in pairwise(first))


def check_times(pairing: Pairing, name: str, clock: Clock) -> None:
    """Refuse, as a `LogError`, labels beside the log of which none has the time of a frame."""
    if not len(pairing.labels):
        raise LogError(f"{name}: the log has no times to pair by; set `truth.pair` to number")
    if next(frames_of(pairing), None) is None:
        theirs, ours = (
            f"{each.stamp(0)} to {each.stamp(len(each) - 1)}"
            for each in (pairing.labels, pairing.images)
        )
        raise LogError(
            f"{name}: none of them belongs to a frame by {clock}: theirs are {theirs} ns, the "
            f"frames' {ours} ns; at most {pairing.tolerance / 1e6:g} ms may lie between "
            "(`topics.sync_tolerance_ms`), or pair by number (`truth.pair`)"
        )


def by_number(labels: LabelPictures, settings: LabelPlace, images: TopicReader) -> Pairing:
    """Pair by frame numbers.

    Frames after the loss of an unknown number of images, or of another log's labels, have no
    certain number, and no label. A `LogError` if no number is a frame's.
    """
    frames, shown = len(images), _as_shown(images)
    if isinstance(labels, TopicReader):
        first = settings.first or 0
        known = labels.sure - first if labels.sure < len(labels) else frames
        unsure = frames - max(0, min(images.sure, known))
        numbers = Times(range(-first, labels.sure - first))
        return Pairing(Times(shown, images.sure), numbers, 0, unsure=unsure)
    name, keys, first = labels.name, labels.log_times, labels.first
    named, cut = labels.images, images.expected() != frames
    if named is not None and (named < frames or (named > frames and not cut)):
        raise LogError(
            f"{name}: {settings.images} holds {named} images and the log {frames}, so it was not "
            "made of all of them: leave `truth.images` out, and pair by number or stamp"
        )
    inside = int(np.count_nonzero((keys >= 0) & (keys < frames)))
    if not inside:
        raise LogError(
            f"{name}: none of them belongs to a frame by {labels.by}: theirs are "
            f"{keys[0] + first} to {keys[-1] + first} ({some([e.path for e in labels.labels])}), "
            f"the frames' {first} to {first + frames - 1}: if {keys[0] + first} is the first "
            "frame's, set `truth.first` to it; or name the folder of the images that the log was "
            "made of with `truth.images`"
        )
    unused = len(labels) - inside + labels.nameless if images.sure == frames else 0
    unsure = frames - images.sure
    return Pairing(Times(shown, images.sure), labels, 0, unused=unused, unsure=unsure)


def _as_shown(images: TopicReader) -> Sequence[int]:
    """Return the number of each image: of a video with B-frames, that in the order of stamps."""
    with suppress(FrameError):
        if not _rise(images) and codec_of(images.picture(0)):
            stamps = [images.stamp(position) for position in range(len(images))]
            ranks: list[int] = np.argsort(np.argsort(stamps, kind="stable")).tolist()
            return ranks
    return range(len(images))
