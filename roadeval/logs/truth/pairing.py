"""The pairing of labels with images: by stamp, or by log time, order, number or name.

Labels may be logged long after their images, so log times alone do not pair them. Stamps are read
only where they are needed: around the stamp of the image.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import islice, pairwise, takewhile, zip_longest
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.files import first_names
from roadeval.logs.messages.pictures import codec_of
from roadeval.logs.settings import NS, LabelPlace
from roadeval.logs.topics.reader import UNREADABLE, TopicInfo, TopicReader, median_period
from roadeval.logs.truth.named_labels import NamedLabels
from roadeval.runtime.sentence import Sentence

REACH: Final = 4
"""Number of messages to compare on either side: topics are logged nearly in the order of stamps. If
the first stamps rise, only messages within so many frame periods, since each may cost a chunk."""
LOOKED_AT: Final = 10
"""Number of first images that decide how labels are paired."""

LabelPictures = TopicReader | NamedLabels
"""Label pictures in the order of their times or numbers."""


class Stamps(Protocol):
    """The stamps of pictures, or numbers in place of them, in nearly ascending order."""

    def __len__(self) -> int: ...

    def stamp(self, position: int) -> int:
        """Return nanoseconds, or `UNREADABLE`."""
        ...


class Times:
    """Ascending numbers in place of stamps; only the first ``sure`` of them are certain."""

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
    """Stamps plus ``offset`` nanoseconds."""

    stamps: Stamps
    offset: int

    def __len__(self) -> int:
        return len(self.stamps)

    def stamp(self, position: int) -> int:
        """Return the stamp at a position plus the offset, or `UNREADABLE`."""
        stamp = self.stamps.stamp(position)
        return stamp if stamp == UNREADABLE else stamp + self.offset


@dataclass(frozen=True, eq=False)
class Nearby:
    """Stamps of a topic near a moment; the others are estimated by their log times, not read.

    The delay from stamp to log time is known from the stamps read so far, to within ``doubt``.
    """

    topic: TopicReader
    moment: int
    doubt: int

    def __len__(self) -> int:
        return len(self.topic)

    def stamp(self, position: int) -> int:
        """Return the stamp at a position, or an estimate if it is far from the moment."""
        if self.topic.delays is None or self.topic.knows(position):
            return self.topic.stamp(position)
        least, greatest = self.topic.delays
        logged = int(self.topic.log_times[position])
        if logged - least + self.doubt < self.moment:
            return logged - least
        if logged - greatest - self.doubt > self.moment:
            return logged - greatest
        return self.topic.stamp(position)


class Clock(StrEnum):
    """A quantity by which the images of a log can be paired with labels."""

    STAMP = "header stamps"
    LOG_TIME = "log times"
    ORDER = "their order"


@dataclass(frozen=True, eq=False)
class Camera:
    """The images that labels are paired with, and the rules for that."""

    images: TopicReader
    topic: TopicInfo
    clock: Clock
    """Header stamps if they differ, else log times if these differ, else their order."""
    tolerance_ns: int
    """Largest time between an image and its label."""
    resize_labels: bool
    """Whether labels of another size are scaled to the image's (nearest pixel)."""


def clock_of(reader: TopicReader) -> Clock:
    """Return the quantity that differs among the first images of a topic."""
    stamps = (reader.stamp(position) for position in range(len(reader)))
    first: list[int] = []
    for stamp in islice((stamp for stamp in stamps if stamp != UNREADABLE), LOOKED_AT):
        first.append(stamp)
        if stamp != first[0]:
            return Clock.STAMP
    if len(first) == 1 and any(first):
        return Clock.STAMP
    times = reader.log_times[:LOOKED_AT]
    return Clock.LOG_TIME if len(times) <= 1 or times[0] != times[-1] else Clock.ORDER


def tolerance(reader: TopicReader, setting_ms: float | None) -> int:
    """Return the tolerance of the setting, else half the frame period, in nanoseconds."""
    if setting_ms is not None:
        return round(setting_ms * 1e6)
    if len(reader) == 1:
        return 50_000_000  # half the period of a camera of 10 Hz
    period = median_period(reader.log_times)
    if period == 0:
        stamps = sorted(reader.stamp(position) for position in range(min(LOOKED_AT, len(reader))))
        period = median_period(np.array([s for s in stamps if s != UNREADABLE], np.int64))
    return period // 2


@dataclass(frozen=True, eq=False)
class Pairing:
    """The pairing of images with the labels of one source.

    An image and a label of the same stamp are a pair (the k-th image and the k-th label, if several
    have it); otherwise the nearest ones within the tolerance are, if each is the other's nearest.
    """

    images: Stamps
    labels: Stamps
    tolerance: int
    """Largest difference between the stamps of a pair."""
    period: int = 0
    """Median nanoseconds between the log times of images; 0 if it is not used."""
    is_small: bool = False
    """Whether all stamps may be read to find an equal one."""
    by: str = Clock.STAMP
    """The quantity that is compared: a `Clock`, or the ``number`` or ``name`` of the frame."""
    unused: int = 0
    """Labels that belong to no frame of the log, if that is known beforehand."""
    note: str = ""
    """A warning about the pairing; empty without one."""
    unsure: int = 0
    """Frames without a label because their number is uncertain: an unknown number of images, or of
    the other log's labels, is lost before them."""

    @cached_property
    def reach_ns(self) -> int | None:
        """The distance (ns) beyond which a search ends; None if stamps may lie anywhere."""
        if self.is_small or not self.period or not (_rise(self.images) and _rise(self.labels)):
            return None
        return max(REACH * self.period, self.tolerance)


def _rise(stamps: Stamps) -> bool:
    """Return whether the first stamps rise."""
    first = [stamps.stamp(position) for position in range(min(LOOKED_AT, len(stamps)))]
    return all(one < other for one, other in pairwise(first))


class Partners:
    """Finds the label of each image; it is fastest with images in order.

    The first search begins at the label position ``near``. If only a ``few`` of the images are
    needed, distant stamps are not read but estimated from log times.
    """

    def __init__(self, pairing: Pairing, near: int = 0, *, few: bool = False) -> None:
        self._pairing = pairing
        self._few = few and not pairing.is_small
        self.near = min(near, max(len(pairing.labels) - 1, 0))
        """Position of a label near the last image's stamp."""
        self.used: set[int] = set()
        """Positions of the labels that have an image."""
        self.missed = 0
        """Images without a label because another image is nearer to it."""

    def of(self, image: int) -> int | None:
        """Return the position of an image's label; None if it has none."""
        label = self._label(image)
        if label is not None:
            self.used.add(label)
        return label

    def _label(self, image: int) -> int | None:
        stamp = self._pairing.images.stamp(image)
        if stamp == UNREADABLE or not len(self._pairing.labels):
            return None
        images, labels = self._around(stamp)
        reach = None if self._few else self._pairing.reach_ns
        near = self.near
        if isinstance(labels, TopicReader) and (there := labels.stamp(near)) != UNREADABLE:
            # Begin where the stamp is if its delay to the log time is the last label's.
            logged = int(labels.log_times[near]) - there + stamp
            place = np.searchsorted(labels.log_times, min(max(logged, -(2**63)), 2**63 - 1))
            near = min(int(place), len(labels) - 1)
        middle = _seek(labels, stamp, near)
        equal = _find_equal(labels, stamp, middle, reach)
        twins = _find_equal(images, stamp, image, reach) if equal else []
        cameras = [_camera_at(self._pairing.images, twin) for twin in twins] if twins[1:] else []
        theirs = [_camera_at(self._pairing.labels, label) for label in equal] if cameras else []
        # If cameras share a topic and a stamp, a label belongs to the one that it names.
        by_camera = len({*cameras}) > 1 and not {*cameras}.isdisjoint(theirs)
        if by_camera:
            ours = cameras[twins.index(image)]
            twins = [at for at, name in zip(twins, cameras, strict=True) if name == ours]
            equal = [at for at, name in zip(equal, theirs, strict=True) if name == ours]
        elif self._pairing.is_small and (not equal or equal[0] in self.used):
            if image in self._all_equal:
                return self._all_equal[image]
        elif not equal:
            equal = _find_equal(labels, stamp, min(self.near + 1, len(labels) - 1), reach)
        if equal or by_camera:
            self.near = equal[0] if equal else self.near
            twins = twins or _find_equal(images, stamp, image, reach)
            rank = sum(1 for other in twins if other < image)
            return equal[rank] if rank < len(equal) else None
        label = self.near = _find_nearest(labels, stamp, middle, reach)
        label_stamp = labels.stamp(label)
        if label_stamp == UNREADABLE or abs(label_stamp - stamp) > self._pairing.tolerance:
            return None
        images, _ = self._around(label_stamp)
        if _find_nearest(images, label_stamp, _seek(images, label_stamp, image), reach) != image:
            self.missed += 1
            return None
        return label

    def _around(self, moment: int) -> tuple[Stamps, Stamps]:
        """Return the stamps of images and labels around a moment."""
        images, labels = self._pairing.images, self._pairing.labels
        if not self._few:
            return images, labels
        both = [side if isinstance(side, Later) else Later(side, 0) for side in (images, labels)]
        delays = [side.stamps.delays for side in both if isinstance(side.stamps, TopicReader)]
        spreads = [most - least for least, most in filter(None, delays)]
        doubt = self._pairing.tolerance + max([*spreads, self._pairing.tolerance // 2])
        images, labels = (
            Later(Nearby(side.stamps, moment - side.offset, doubt), side.offset)
            if isinstance(side.stamps, TopicReader)
            else side
            for side in both
        )
        return images, labels

    @cached_property
    def _all_equal(self) -> dict[int, int | None]:
        """The label of each image that has the same stamp, at any distance."""
        images, labels = defaultdict[int, list[int]](list), defaultdict[int, list[int]](list)
        for stamps, places in ((self._pairing.images, images), (self._pairing.labels, labels)):
            for place in range(len(stamps)):
                places[stamps.stamp(place)].append(place)
        pairs = (zip_longest(images.get(stamp, ()), labels[stamp]) for stamp in labels)
        return {image: label for both in pairs for image, label in both if image is not None}

    def unpaired(self, *, of_all: bool) -> tuple[int, int]:
        """Count the labels without an image: all, or only those between labels with an image.

        Also return the nanoseconds between the first one and the nearest image.
        """
        images, labels = self._pairing.images, self._pairing.labels
        first, last = min(self.used, default=0), max(self.used, default=0)
        places = range(len(labels)) if of_all else range(first, last)
        stamps = [labels.stamp(place) for place in places if place not in self.used]
        stamps = [stamp for stamp in stamps if stamp != UNREADABLE]
        if not stamps:
            return 0, 0
        middle = _seek(images, stamps[0], 0)
        nearest = _find_nearest(images, stamps[0], middle, self._pairing.reach_ns)
        return len(stamps), abs(images.stamp(nearest) - stamps[0])


def frames_of(
    pairing: Pairing, begin: int = 0, end: int | None = None, *, few: bool = False
) -> Iterator[int]:
    """Yield the position of each label's image, in the order of the labels from ``begin`` on.

    `Partners` explains ``few``.
    """
    images, labels = pairing.images, pairing.labels
    back = Partners(replace(pairing, images=labels, labels=images), few=few)
    forth = Partners(pairing, few=few)
    for label in range(len(labels))[begin:end]:
        image = back.of(label)
        # If many stamps are equal or out of order, two labels may find the same image.
        if image is not None and forth.of(image) == label:
            yield image


def _camera_at(stamps: Stamps, position: int) -> str:
    """Return the ``frame_id`` at a position; empty if there is none."""
    reader = stamps.stamps if isinstance(stamps, Later) else stamps
    return reader.frame_id(position) if isinstance(reader, TopicReader) else ""


def _find_nearest(stamps: Stamps, stamp: int, middle: int, reach: int | None) -> int:
    """Return the position of the nearest stamp around a position (the first if several are)."""

    def distance(position: int) -> int:
        other = stamps.stamp(position)
        return 2**64 if other == UNREADABLE else abs(other - stamp)

    return min(_window(stamps, stamp, middle, reach), key=distance)


def _find_equal(stamps: Stamps, stamp: int, middle: int, reach: int | None) -> list[int]:
    """Return the positions of a stamp around a position, in order.

    If equal stamps fill the window at an end, they are followed beyond it.
    """
    window = _window(stamps, stamp, middle, None if reach is None else 0)
    equal = [place for place in window if stamps.stamp(place) == stamp]
    if equal and equal[0] == window[0]:
        before = takewhile(lambda at: stamps.stamp(at) == stamp, range(equal[0] - 1, -1, -1))
        equal = [*reversed([*before]), *equal]
    if equal and equal[-1] == window[-1]:
        equal += takewhile(lambda at: stamps.stamp(at) == stamp, range(equal[-1] + 1, len(stamps)))
    return equal


def _window(stamps: Stamps, stamp: int, middle: int, reach: int | None) -> range:
    """Return the positions around one, on each side up to the first stamp beyond the reach."""
    first, last = max(middle - REACH, 0), min(middle + REACH, len(stamps) - 1)
    if reach is not None:
        left, right = range(middle - 1, first, -1), range(middle, last)
        too_early = (at for at in left if UNREADABLE < stamps.stamp(at) < stamp - reach)
        too_late = (at for at in right if stamps.stamp(at) > stamp + reach)
        first, last = next(too_early, first), next(too_late, last)
    return range(first, last + 1)


def _seek(stamps: Stamps, stamp: int, hint: int) -> int:
    """Return the first position at or after a stamp, by a galloping search from a hint.

    An unreadable stamp counts as the next readable one.
    """

    def at(position: int) -> int:
        around = range(position, min(position + REACH, len(stamps)))
        return next((s for s in map(stamps.stamp, around) if s != UNREADABLE), UNREADABLE)

    low, high, step = hint, hint, 1
    while low > 0 and at(low) >= stamp:
        low, high, step = max(low - step, 0), low, step * 2
    step = 1
    while high < len(stamps) and at(high) < stamp:
        low, high, step = high, min(high + step, len(stamps)), step * 2
    return min(bisect_left(range(len(stamps)), stamp, low, high, key=at), len(stamps) - 1)


def by_time(labels: LabelPictures, camera: Camera, offset_ms: float = 0.0) -> Pairing:
    """Pair by stamps, by log times, or by order if the log has no times at all.

    The offset is added to the labels' times. Order pairs only if there is a label for each image.
    """
    images, clock, offset = camera.images, camera.clock, round(offset_ms * 1e6)
    note = ""
    if clock is Clock.STAMP and isinstance(labels, TopicReader):
        check_clocks(images, labels, offset)
        ends = {labels.stamp(position) for position in (0, len(labels) - 1) if len(labels)}
        if ends == {0} and images.stamp(0):
            clock = Clock.LOG_TIME
            note = "its stamps are 0, so log times pair it: what was logged late fits no frame"
    elif clock is Clock.STAMP and isinstance(labels, NamedLabels) and len(labels):
        clock, note = _find_clock(images, labels, camera.tolerance_ns, offset)
    if clock is Clock.STAMP:
        is_small = images.is_small and (isinstance(labels, NamedLabels) or labels.is_small)
        stamps = Later(labels, offset) if offset else labels
        period = median_period(images.log_times)
        return Pairing(images, stamps, camera.tolerance_ns, period, is_small, note=note)
    if clock is Clock.LOG_TIME:
        times = Times(images.log_times), Times(labels.log_times + offset)
        return Pairing(*times, camera.tolerance_ns, by=clock, note=note)
    count = labels.sure if len(images) == len(labels) else 0
    unsure = len(images) - min(images.sure, labels.sure)
    numbers = Times(range(len(images)), images.sure), Times(range(count))
    return Pairing(*numbers, camera.tolerance_ns, by=clock, unsure=unsure)


def check_clocks(images: TopicReader, labels: TopicReader, offset: int) -> None:
    """Raise a `LogError` if labels have stamps of another clock than the images.

    Their delay from stamp to log time then differs from the images' by the same time at both ends.
    Labels that were only logged late have stamps among the images', or log times behind theirs.
    """
    if not len(labels):
        return
    both = (images, labels)
    ours, theirs = ([reader.stamp(0), reader.stamp(len(reader) - 1)] for reader in both)
    begin, end = (theirs[place] + offset - ours[place] for place in (0, 1))
    logged, last = (int(labels.log_times[at]) - int(images.log_times[at]) for at in (0, -1))
    apart = begin - logged
    # Any two of GPS, TAI and UTC differ by more than three seconds.
    if min(*ours, *theirs) <= 0 or abs(apart) < 3 * NS or 4 * abs(end - last - apart) > abs(apart):
        return
    ratio = theirs[0] / ours[0]
    thousands = round(math.log(ratio, 1000))
    if thousands and 0.99 < ratio / 1000.0**thousands < 1.01:
        raise LogError(
            f"its stamps are {ratio:.3g} times those of {images.name}: one of them is not in "
            "nanoseconds",
            where=labels.name,
        )
    outside = 2 * (-begin if apart < 0 else end) > abs(apart)
    one_log = labels.channels[0].container in [channel.container for channel in images.channels]
    if outside or (one_log and 2 * max(-logged, last) <= abs(apart)):
        # Labels come some moments after their images, so nearly a full second is one.
        seconds = round(apart / NS, 0 if abs(apart / NS - round(apart / NS)) < 0.2 else 3)
        side = "before" if seconds < 0 else "after"
        remedy = "{topics.sync_offset_ms} {} moves the truth's to the images'"
        raise LogError(
            f"its stamps are of another clock than those of {images.name}: they lie about "
            f"{abs(seconds):g} s {side} them for the same log times",
            where=labels.name,
            remedy=Sentence(remedy, round(-seconds * 1000)),
        )


def _find_clock(
    images: TopicReader, labels: NamedLabels, tolerance_ns: int, offset: int
) -> tuple[Clock, str]:
    """Return whether the times in the labels' names are stamps or log times, and a warning.

    They are log times if none is the stamp of an image, and they lie after or nearer to log times,
    which belong to other frames than the nearest stamps.
    """
    keys, logged = labels.log_times + offset, images.log_times
    keys = keys[np.unique(np.linspace(0, len(keys) - 1, 2 * LOOKED_AT, dtype=int))]
    frames = []
    for key in keys.tolist():
        hint = min(int(np.searchsorted(logged, key)), len(images) - 1)
        near_stamp = _find_nearest(images, key, _seek(images, key, hint), None)
        frames.append([near_stamp, _find_nearest(Times(logged), key, hint, None)])
    by_stamp, by_log = np.array(frames).T
    behind = keys - [images.stamp(frame) for frame in by_stamp.tolist()]
    after = keys - logged[by_log]
    step = next(10**n for n in range(9, 2, -1) if n == 3 or not (keys % 10**n).any())
    if np.median(np.abs(behind)) < step or np.abs([behind, after]).min() > tolerance_ns:
        return Clock.STAMP, ""
    stamped, away = (float(np.median(times)) / 1e6 for times in (behind, after))
    is_nearer = (stamped < 0, abs(stamped)) <= (away < 0, abs(away))
    if np.median(np.abs(after)) >= step and (is_nearer or (by_stamp == by_log).all()):
        return Clock.STAMP, Sentence(
            "no name is the stamp of a frame: by median they lie {} ms after the nearest one; "
            "if they are of another one, {topics.sync_offset_ms} moves them",
            f"{stamped:.1f}",
        )
    met = int(np.count_nonzero(np.abs(after) <= tolerance_ns))
    return Clock.LOG_TIME, (
        f"no name is the stamp of a frame: log times pair them, for {met} of the {len(keys)} that "
        f"were looked at lie {away:.1f} ms after a frame's log time, by median"
    )


def check_times(pairing: Pairing, name: str) -> None:
    """Raise a `LogError` if no label beside the log has the time of a frame."""
    if not len(pairing.labels):
        remedy = Sentence("set {truth.pair} to number")
        raise LogError("the log has no times to pair by", where=name, remedy=remedy)
    if next(frames_of(pairing), None) is None:
        theirs, ours = (
            f"{stamps.stamp(0)} to {stamps.stamp(len(stamps) - 1)}"
            for stamps in (pairing.labels, pairing.images)
        )
        raise LogError(
            f"none of them belongs to a frame by {pairing.by}: theirs are {theirs} ns, the frames' "
            f"{ours} ns",
            where=name,
            remedy=Sentence(
                "allow more than {} ms between them with {topics.sync_tolerance_ms}, or pair by "
                "number with {truth.pair}",
                f"{pairing.tolerance / 1e6:g}",
            ),
        )


def by_number(labels: LabelPictures, settings: LabelPlace, images: TopicReader) -> Pairing:
    """Pair by frame numbers.

    Frames after the loss of an unknown number of images, or of another log's labels, have no
    certain number, and no label. A `LogError` if no label has the number of a frame.
    """
    frames = len(images)
    shown: Sequence[int] = range(frames)
    with suppress(FrameError):
        # A video with B-frames is numbered in the order of stamps.
        if not _rise(images) and codec_of(images.picture(0)):
            stamps = [images.stamp(position) for position in range(frames)]
            shown = np.argsort(np.argsort(stamps, kind="stable")).tolist()
    if isinstance(labels, TopicReader):
        first = settings.first or 0
        certain = labels.sure - first if labels.sure < len(labels) else frames
        unsure = frames - max(0, min(images.sure, certain))
        numbers = Times(range(-first, labels.sure - first))
        return Pairing(Times(shown, images.sure), numbers, 0, by="number", unsure=unsure)
    name, keys, first = labels.name, labels.log_times, labels.first
    in_folder, is_cut = labels.images, images.expected() != frames
    if in_folder is not None and (in_folder < frames or (in_folder > frames and not is_cut)):
        raise LogError(
            f"{settings.images} holds {in_folder} images and the log {frames}, so it was not made "
            "of all of them",
            where=name,
            setting="truth.images",
            remedy="leave it out, and pair by number or stamp",
        )
    inside = int(np.count_nonzero((keys >= 0) & (keys < frames)))
    if not inside:
        names = first_names([label.path for label in labels.labels])
        raise LogError(
            f"none of them belongs to a frame by {labels.by}: theirs are {keys[0] + first} to "
            f"{keys[-1] + first} ({names}), the frames' {first} to {first + frames - 1}",
            where=name,
            remedy=Sentence(
                "if {} is the first frame's, set {truth.first} to it; or name the folder of the "
                "images that the log was made of with {truth.images}",
                keys[0] + first,
            ),
        )
    unused = len(labels) - inside + labels.nameless if images.sure == frames else 0
    unsure = frames - images.sure
    numbers = Times(shown, images.sure)
    return Pairing(numbers, labels, 0, by=labels.by, unused=unused, unsure=unsure)
