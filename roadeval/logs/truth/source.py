"""Labels of one source, settled before the first frame: where they lie, and by which rules."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from roadeval.images import Limits
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.messages.pictures import Picture, PictureSequence
from roadeval.logs.messages.pixels import size_of
from roadeval.logs.settings import LabelPlace, MaskSettings
from roadeval.logs.topics.reader import TopicReader
from roadeval.logs.truth.meaning import (
    Confidence,
    Labels,
    Meaning,
    of_classes,
    seen_in,
    understand,
)
from roadeval.logs.truth.pairing import (
    LOOKED_AT,
    Camera,
    LabelPictures,
    LabelSet,
    NamedLabels,
    Pairing,
    Partners,
    by_number,
    by_time,
    check_times,
)

_TOPIC_OF_A_LOG: Final = re.compile(r"(.+\.mcap|.{2,}(?=:/)):(.+)")
"""A letter alone before the colon is a disk's."""


@dataclass(frozen=True, slots=True, eq=False)
class LabelSource:
    """Labels of one source: truth, true shadow, or another method's masks."""

    where: str
    """The topic, the folder, or the topic and its log, for a person."""
    pictures: LabelPictures
    meaning: Meaning
    pairing: Pairing
    why: str
    """Why they were chosen, or how they are paired, in words."""
    digest: Callable[[], str] | None = None
    """Computes the digest of what lies beside the log, in hexadecimal."""
    notes: tuple[str, ...] = ()
    """Warnings about labels beside the log, a sentence each."""

    @property
    def is_confidence(self) -> bool:
        """Whether they are thresholds on how probable road is."""
        return isinstance(self.meaning, Confidence)

    def partners(self, logged_ns: int) -> Partners:
        """Pair images with labels, beginning at an image of that log time."""
        return Partners(self.pairing, int(np.searchsorted(self.pictures.log_times, logged_ns)))

    def label(self, position: int) -> Label:
        """Read the label at a position; it is not decoded yet."""
        picture = read_or_error(self.pictures, position)
        return Label(self, picture, self.pictures.place(position))


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A label of a frame as logged, which any thread can decode."""

    source: LabelSource
    picture: Picture | FrameError
    """The picture, or why it cannot be read."""
    place: str
    """Where it lies: its topic, or its own file."""

    def read(self, limits: Limits) -> Labels:
        """Decode the label; a `BadMessage` or `FrameError` if that is impossible."""
        if isinstance(self.picture, FrameError):
            raise self.picture
        return self.source.meaning.read(self.picture, limits)


def read_or_error(pictures: PictureSequence, position: int) -> Picture | FrameError:
    """Return a picture, or the error if it cannot be read."""
    try:
        return pictures.picture(position)
    except FrameError as error:
        return error


def samples(pictures: LabelPictures) -> Iterator[tuple[str, Picture]]:
    """Read the first pictures, and some spread over the rest, as far as they can be read.

    Each comes with its place.
    """
    count = len(pictures)
    spread = np.linspace(0, count - 1, LOOKED_AT, dtype=int).tolist() if count else []
    for position in sorted({*range(min(LOOKED_AT, count)), *spread}):
        with suppress(FrameError):
            yield pictures.place(position), pictures.picture(position)


def beside_log(
    labels: LabelPictures,
    settings: MaskSettings,
    camera: Camera,
    digest: Callable[[], str],
    log: str = "",
) -> LabelSource:
    """Settle labels that have names, or those of a topic of another ``log``.

    A `LogError` if none belongs to a frame, they cannot be understood, or are of another size.
    """
    if not isinstance(labels, TopicReader):
        by, count, where = labels.by, f"{len(labels)} labels", labels.name
    elif settings.images is None:
        by, where = settings.pair or "stamp", f"{labels.name} of {log}" if log else labels.name
        count = f"{len(labels)} messages"
    else:
        raise LogError("`truth.images` is for labels with names: those of a log have none")
    if by == "stamp":
        pairing = by_time(labels, camera)
        check_times(pairing, labels.name, camera.clock)
    else:
        pairing = by_number(labels, settings, camera.images)
    from_log = isinstance(labels, TopicReader)
    words = camera.clock if from_log and settings.pair is None else by
    meaning = meaning_of(labels, settings, camera)
    notes = labels.origin.notes if isinstance(labels, NamedLabels) else ()
    why = f"{count}, paired by {words}"
    return LabelSource(where, labels, meaning, pairing, why, digest, notes)


def log_and_topic(path: str) -> tuple[str | None, str | None]:
    """Return the log and the topic that a path of labels names; no log for a folder or a file.

    >>> log_and_topic("night/masks.mcap:/net/road")
    ('night/masks.mcap', '/net/road')
    """
    if (found := _TOPIC_OF_A_LOG.fullmatch(path)) is not None:
        return found[1], found[2]
    return (path if path.endswith(".mcap") else None), None


def label_files(settings: LabelPlace) -> list[Path]:
    """Return the files that hold labels, or give them their frames, even if they do not exist.

    An OSError if a folder cannot be listed.
    """
    named = (log_and_topic(settings.path)[0] or settings.path, settings.images)
    paths = [Path(each) for each in named if each is not None]
    return [f for each in paths for f in (sorted(each.rglob("*")) if each.is_dir() else [each])]


def check_size(labels: str, size: tuple[int, int] | None, camera: Camera) -> None:
    """Refuse labels of another size than the images', unless they are resized; a `LogError`."""
    wanted = camera.topic.size
    if camera.resize_labels or size is None or wanted is None or size == wanted:
        return
    theirs, ours = ("x".join(map(str, each)) for each in (size, wanted))
    raise LogError(
        f"{labels} is {theirs}, but {camera.topic.name} is {ours}: scale the labels with "
        "`topics.resize_truth`"
    )


def nothing_of(pictures: LabelPictures, problem: str) -> LogError:
    """Return the error that no picture can be decoded, with the reason of the first one."""
    if not problem:
        first = read_or_error(pictures, 0) if len(pictures) else "it holds no picture"
        problem = str(first)
    return LogError(f"nothing of {pictures.name} can be decoded: {problem}")


def meaning_of(
    labels: LabelPictures, settings: MaskSettings, camera: Camera | None = None
) -> Meaning:
    """Find the meaning of labels by looking at some; of those beside the log check the size, too.

    A `LogError` if their values cannot be understood.
    """
    origin = labels.origin if isinstance(labels, NamedLabels) else LabelSet(())
    wanted = settings.labels
    confidence = None if settings.threshold is None else Confidence(settings.threshold)
    seen: list[int] = []
    problem = ""
    for place, picture in samples(labels):
        try:
            if camera is not None:
                check_size(place, size_of(picture), camera)
            if confidence is None:
                seen += seen_in(picture, wanted, labels.name, labels.limits)
            else:
                seen.append(int(confidence.codes(picture, labels.limits).max()))
        except BadMessage as error:
            problem = problem or str(error)
    if not seen:
        raise nothing_of(labels, problem)
    if confidence is not None:
        return confidence
    if origin.occurring:
        return of_classes(wanted, origin, labels.name)
    return understand(wanted, seen, labels.name)
