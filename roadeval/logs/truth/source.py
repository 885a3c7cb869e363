"""Labels of one source, settled before the first frame: where they lie, and by which rules."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from roadeval.images import Limits
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.messages.pictures import Picture, RawPicture
from roadeval.logs.messages.pixels import format_of, size_of
from roadeval.logs.messages.video import PictureSequence
from roadeval.logs.settings import LabelSettings, MaskSettings
from roadeval.logs.topics.reader import UNREADABLE, TopicReader
from roadeval.logs.truth.folder import LabelFolder
from roadeval.logs.truth.meaning import TOP, Confidence, Labels, Meaning, seen_in, understand
from roadeval.logs.truth.pairing import (
    LOOKED_AT,
    Camera,
    Clock,
    Pairing,
    Partners,
    Stamps,
    Times,
)

_TOPIC_OF_A_LOG: Final = re.compile(r"(.+\.mcap|.{2,}(?=:/)):(.+)")
"""A letter alone before the colon is a disk's."""
_CLASSES: Final = 64
"""Values of more than so many kinds may be confidences."""
_BYTE: Final = 255
"""Greatest code of a confidence map of 16 bits that was made for 8."""
_ONES: Final = (1, 257)
"""Greatest codes of a confidence map whose greatest value is 1, of 16 and of 8 bits."""


class Pictures(PictureSequence, Stamps, Protocol):
    """Label pictures in the order of their times: a topic's, or a folder's."""

    @property
    def name(self) -> str:
        """The topic, or the folder."""

    @property
    def limits(self) -> Limits:
        """On the pictures."""

    @property
    def log_times(self) -> npt.NDArray[np.int64]:
        """``(n,)`` int64, rising."""

    @property
    def sure(self) -> int:
        """How many of them, from the first one on, are certain to have their original positions."""

    def __len__(self) -> int: ...

    def place(self, position: int) -> str:
        """Return where a picture lies, for messages to people."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class LabelSource:
    """Labels of one source: truth, true shadow, or another method's masks."""

    where: str
    """The topic, the folder, or the topic and its log, for a person."""
    pictures: Pictures
    meaning: Meaning
    """How they are read."""
    pairing: Pairing
    """By what they are paired with images."""
    why: str
    """Why they were chosen, or how they are paired, in words."""
    digest: Callable[[], str] | None = None
    """Computes the SHA-256 of what lies beside the log, in hexadecimal."""

    @property
    def is_confidence(self) -> bool:
        """Whether they are thresholds on how probable road is."""
        return isinstance(self.meaning, Confidence)

    def begin(self, logged_ns: int) -> Partners:
        """Begin to pair images with labels at an image of that log time."""
        return self.pairing.begin(int(np.searchsorted(self.pictures.log_times, logged_ns)))

    def label(self, position: int) -> Label:
        """Read the label at a position, not decoded yet."""
        picture = read_or_error(self.pictures, position)
        return Label(picture, self.meaning, self.pictures.name, self.pictures.place(position))


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A label of a frame as logged, which any thread can decode."""

    picture: Picture | FrameError
    """The picture, or why it cannot be read."""
    meaning: Meaning
    """How it is read."""
    source: str
    """The topic or folder that it comes from."""
    place: str
    """That, or its own file."""

    def read(self, limits: Limits) -> Labels:
        """Decode the label; a `BadMessage` or `FrameError` if that is impossible."""
        if isinstance(self.picture, FrameError):
            raise self.picture
        return self.meaning.read(self.picture, limits)


def read_or_error(pictures: PictureSequence, position: int) -> Picture | FrameError:
    """Return a picture, or the error that it cannot be read."""
    try:
        return pictures.picture(position)
    except FrameError as error:
        return error


def samples(reader: PictureSequence) -> Iterator[Picture]:
    """Read the first pictures of a topic, or of a folder, and some spread over the rest."""
    if not len(reader):
        return
    spread = np.linspace(0, max(len(reader) - 1, 0), LOOKED_AT, dtype=int).tolist()
    for position in sorted({*range(min(LOOKED_AT, len(reader))), *spread}):
        with suppress(FrameError):
            yield reader.picture(position)


def in_log(
    labels: TopicReader, why: str, settings: LabelSettings, camera: Camera, *, several: bool
) -> LabelSource:
    """Settle a label topic of the log itself, whose size is known to fit.

    Raises
    ------
    LogError
        If its values cannot be understood.
    """
    meaning = _meaning(labels, MaskSettings(labels=settings), several=several)
    pairing = Pairing(*_stamps(labels, camera), camera.tolerance_ns)
    return LabelSource(labels.name, labels, meaning, pairing, why)


def in_folder(folder: LabelFolder, settings: MaskSettings, camera: Camera) -> LabelSource:
    """Settle the labels of a folder.

    Raises
    ------
    LogError
        If none belongs to a frame, they cannot be understood, or are of another size.
    """
    if folder.by == "stamp":
        pairing = _by_time(folder, camera)
    else:
        pairing = _by_number(folder, settings, camera.images)
    why = f"{len(folder)} files, paired by {folder.by}"
    meaning = _meaning(folder, settings, camera)
    return LabelSource(folder.name, folder, meaning, pairing, why, lambda: folder.digest)


def in_other_log(
    labels: TopicReader,
    settings: MaskSettings,
    camera: Camera,
    *,
    log: str,
    digest: Callable[[], str],
) -> LabelSource:
    """Settle the labels of a topic of another log; errors as of `in_folder`."""
    if settings.images is not None:
        raise LogError("images are for a folder of masks: those of a log have no names")
    if settings.pair == "number":
        images, sure = camera.images, labels.sure
        frames = Times(range(len(images)), images.sure)
        numbers = Times(range(-settings.first, sure - settings.first))
        lost = sure - settings.first if sure < len(labels) else len(images)
        unsure = len(images) - max(0, min(images.sure, lost))
        pairing = Pairing(frames, numbers, 0, unsure=unsure)
    else:
        pairing = _by_time(labels, camera)
    why = f"{len(labels)} messages, paired by {settings.pair or camera.clock}"
    meaning = _meaning(labels, settings, camera)
    return LabelSource(f"{labels.name} of {log}", labels, meaning, pairing, why, digest)


def log_and_topic(path: str) -> tuple[str, str] | None:
    """Return the parts of ``LOG.mcap:/topic``; None of a folder's path.

    >>> log_and_topic("night/masks.mcap:/net/road")
    ('night/masks.mcap', '/net/road')
    """
    found = _TOPIC_OF_A_LOG.fullmatch(path)
    return None if found is None else (found[1], found[2])


def mask_files(settings: MaskSettings) -> list[Path]:
    """Return the files that hold masks, or give them their frames, whether they are there or not.

    An OSError if a folder cannot be listed.
    """
    place = log_and_topic(settings.path)
    named = (settings.path if place is None else place[0], settings.images)
    folders = [Path(each) for each in named if each is not None]
    return [f for each in folders for f in (sorted(each.iterdir()) if each.is_dir() else [each])]


def _stamps(labels: Pictures, camera: Camera) -> tuple[Stamps, Stamps]:
    """Return the times by which images and labels are paired."""
    images = camera.images
    if camera.clock is Clock.STAMP:
        return images, labels
    if camera.clock is Clock.LOG_TIME:
        return Times(images.log_times), Times(labels.log_times)
    # Without any time, order means something only if there is a label for each image.
    count = len(labels) if len(images) == len(labels) else 0
    return Times(range(len(images)), images.sure), Times(range(min(count, labels.sure)))


def _by_time(labels: Pictures, camera: Camera) -> Pairing:
    """Pair by stamps, or what takes their place; a `LogError` if labels lie at other times."""
    stamps = _stamps(labels, camera)
    frames, theirs = (
        [each.stamp(place) for place in (0, len(each) - 1)] if len(each) else [] for each in stamps
    )
    if not theirs:
        raise LogError(f"{labels.name}: the log has no times to pair masks by; pair by number")
    apart = max(frames[0] - theirs[1], theirs[0] - frames[1])
    if UNREADABLE not in (*frames, *theirs) and apart > camera.tolerance_ns:
        raise LogError(
            f"{labels.name}: no mask belongs to a frame: theirs are from {theirs[0]} to "
            f"{theirs[1]} ns, the frames from {frames[0]} to {frames[1]} ns, by {camera.clock}"
        )
    count = len(camera.images)
    sure = min(camera.images.sure, labels.sure) if camera.clock is Clock.ORDER else count
    return Pairing(*stamps, camera.tolerance_ns, unsure=count - sure)


def _by_number(folder: LabelFolder, settings: MaskSettings, images: TopicReader) -> Pairing:
    """Pair by frame numbers; a `LogError` if none is a frame's, or they look shifted by one.

    Frames after the loss of an unknown number of images have no certain number, and no label.
    """
    keys, first = folder.log_times, settings.first
    frames, sure = len(images), images.sure
    named, cut = folder.images, images.expected() != frames
    if named is not None and (named < frames or (named > frames and not cut)):
        raise LogError(
            f"{folder.name}: {settings.images} holds {named} images and the log {frames}, so it "
            "was not made of all of them: leave `images` out, and pair masks by number or stamp"
        )
    inside = int(np.count_nonzero((keys >= 0) & (keys < frames)))
    if not inside:
        theirs = f"{keys[0] + first} to {keys[-1] + first}" if len(keys) else "none"
        what = "no image has the name of one" if folder.by == "name" else f"theirs are {theirs}"
        raise LogError(
            f"{folder.name}: no mask belongs to a frame by {folder.by}: {what}, and the frames' "
            f"numbers are {first} to {first + frames - 1}"
        )
    if folder.by == "number" and (keys[0], keys[-1]) == (1, frames) and len(keys) == frames:
        raise LogError(
            f"{folder.name}: its numbers are {first + 1} to {first + frames}, and the frames' "
            f"{first} to {first + frames - 1}: if its masks begin at the first frame, set first = "
            f"{first + 1} in [masks]"
        )
    unused = len(folder) - inside + folder.nameless if sure == frames else 0
    return Pairing(Times(range(frames), sure), folder, 0, unused, frames - sure)


def check_same_size(
    labels: str, size: tuple[int, int] | None, image: str, wanted: tuple[int, int] | None
) -> None:
    """Refuse labels of another size than the images'; a `LogError`."""
    if size != wanted:
        ours, theirs = ("x".join(map(str, each or ())) for each in (wanted, size))
        raise LogError(
            f"{labels} is {theirs}, but {image} is {ours}: scale the labels with "
            "`topics.resize_truth`"
        )


def _meaning(
    labels: Pictures,
    settings: MaskSettings,
    camera: Camera | None = None,
    *,
    several: bool = False,
) -> Meaning:
    """Look at some labels: their values must be known, and the size of those beside the log fit."""
    confidence = None if settings.threshold is None else Confidence(settings.threshold)
    seen: list[int] = []
    problem, fractions = "", False
    for picture in samples(labels):
        try:
            if camera is not None:
                check_size(labels.name, size_of(picture), camera)
            if confidence is None:
                seen += seen_in(picture, settings.labels, labels.name, labels.limits)
            else:
                seen.append(int(confidence.codes(picture, labels.limits).max()))
                fractions |= isinstance(picture, RawPicture) and format_of(picture).dtype == "f4"
        except BadMessage as error:
            problem = problem or str(error)
    if not seen:
        raise nothing_of(labels, problem)
    if confidence is not None:
        _check_confidence(max(seen), labels.name, fractions=fractions)
        return confidence
    try:
        return understand(settings.labels, seen, labels.name, several=several)
    except LogError as error:
        if camera is None or len(set(seen)) <= _CLASSES:
            raise
        raise LogError(f"{error}; or, for confidences, their threshold") from error


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


def nothing_of(pictures: Pictures, problem: str) -> LogError:
    """Return the error that none of some pictures can be decoded: as the first one shows."""
    if not problem:
        first = read_or_error(pictures, 0) if len(pictures) else "it holds no picture"
        problem = str(first)
    return LogError(f"nothing of {pictures.name} can be decoded: {problem}")


def _check_confidence(greatest: int, name: str, *, fractions: bool) -> None:
    """Refuse, as a `LogError`, what is no confidence map by its greatest code."""
    if greatest in _ONES:
        raise LogError(f"{name} holds only 0 and 1, as masks do: leave out the threshold")
    if 0 < greatest <= _BYTE and not fractions:
        raise LogError(
            f"{name} holds no confidence above {greatest / TOP:.4f}: whole numbers of 16 bits "
            "count as shares of 65535; write those from 0 to 255 with 8 bits"
        )
