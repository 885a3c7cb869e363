"""Masks that lie beside the log, settled before the first frame: where, and by which rules."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.masks.folder import MaskFolder
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.messages.pixels import size_of
from roadeval.logs.settings import MaskSettings
from roadeval.logs.topics.confidence import TOP, Confidence, holds_fractions
from roadeval.logs.topics.label_meaning import understand
from roadeval.logs.topics.label_reader import LabelPictures, Times, clocks_of
from roadeval.logs.topics.labels import Meaning, seen_in
from roadeval.logs.topics.mask_source import MaskPairing, MaskSource
from roadeval.logs.topics.pairing import UNREADABLE
from roadeval.logs.topics.reader import TopicReader
from roadeval.logs.topics.selection import Clock, Selection, samples

_TOPIC_OF_A_LOG: Final = re.compile(r"(.+\.mcap|.{2,}(?=:/)):(.+)")
"""A letter alone before the colon is a disk's."""
_CLASSES: Final = 64
"""Values of more than so many kinds may be confidences."""
_BYTE: Final = 255
"""Greatest code of a confidence map of 16 bits that was made for 8."""
_ONES: Final = (1, 257)
"""Greatest codes of a confidence map whose greatest value is 1, of 16 and of 8 bits."""


def log_and_topic(path: str) -> tuple[str, str] | None:
    """Return the parts of ``LOG.mcap:/topic``; None of a folder's path.

    >>> log_and_topic("night/masks.mcap:/net/road")
    ('night/masks.mcap', '/net/road')
    """
    found = _TOPIC_OF_A_LOG.fullmatch(path)
    return None if found is None else (found[1], found[2])


def of_folder(
    folder: MaskFolder, settings: MaskSettings, selection: Selection, images: TopicReader
) -> MaskSource:
    """Settle the masks of a folder.

    Raises
    ------
    LogError
        If none belongs to a frame, they cannot be understood, or are of another size.
    """
    if folder.by == "stamp":
        pairing = _by_time(images, folder, selection)
    else:
        pairing = _by_number(images, folder, settings)
    why = f"{len(folder)} files, paired by {folder.by}"
    meaning = _meaning(folder, settings, selection)
    return MaskSource(folder.name, folder, meaning, pairing, why, lambda: folder.digest)


def of_topic(
    reader: TopicReader,
    settings: MaskSettings,
    selection: Selection,
    images: TopicReader,
    *,
    log: str,
    digest: Callable[[], str],
) -> MaskSource:
    """Settle the masks of a topic of another log.

    Raises
    ------
    LogError
        As `of_folder`.
    """
    if settings.images is not None:
        raise LogError("images are for a folder of masks: those of a log have no names")
    if settings.pair == "number":
        numbers = Times(range(-settings.first, reader.sure - settings.first))
        frames = Times(range(len(images)), images.sure)
        lost = reader.sure - settings.first if reader.sure < len(reader) else len(images)
        unsure = len(images) - max(0, min(images.sure, lost))
        pairing = MaskPairing((frames, numbers), 0, 0, unsure)
    else:
        pairing = _by_time(images, reader, selection)
    by = settings.pair or str(selection.clock)
    why = f"{len(reader)} messages, paired by {by}"
    meaning = _meaning(reader, settings, selection)
    return MaskSource(f"{reader.name} of {log}", reader, meaning, pairing, why, digest)


def mask_stamp(settings: MaskSettings) -> Mapping[str, Any]:
    """Return what tells at little cost whether masks have changed: size and time of each file.

    Empty where they cannot be looked at.
    """
    place = log_and_topic(settings.path)
    folders = [Path(settings.path if place is None else place[0])]
    if settings.images is not None:
        folders.append(Path(settings.images))
    files = [file for each in folders for file in ([each] if each.is_file() else _inside(each))]
    with suppress(OSError):
        facts = {str(file): file.stat() for file in files}
        return {name: [each.st_size, each.st_mtime_ns] for name, each in facts.items()}
    return {}


def _inside(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.is_dir() else []


def _by_time(images: TopicReader, masks: LabelPictures, selection: Selection) -> MaskPairing:
    """Pair by stamps, or what takes their place; a `LogError` if masks lie at other times."""
    clocks = clocks_of(images, masks, selection.clock)
    frames, theirs = (
        [clock.stamp(place) for place in (0, len(clock) - 1)] if len(clock) else []
        for clock in clocks
    )
    if not theirs:
        raise LogError(f"{masks.name}: the log has no times to pair masks by; pair by number")
    known = UNREADABLE not in (*frames, *theirs)
    apart = max(frames[0] - theirs[1], theirs[0] - frames[1])
    if known and apart > selection.tolerance_ns:
        raise LogError(
            f"{masks.name}: no mask belongs to a frame: theirs are from {_span(theirs)}, the "
            f"frames from {_span(frames)}, by {selection.clock}"
        )
    sure = min(images.sure, masks.sure) if selection.clock is Clock.ORDER else len(images)
    return MaskPairing(clocks, selection.tolerance_ns, 0, len(images) - sure)


def _span(stamps: list[int]) -> str:
    return f"{stamps[0]} to {stamps[1]} ns"


def _by_number(images: TopicReader, folder: MaskFolder, settings: MaskSettings) -> MaskPairing:
    """Pair by frame numbers; a `LogError` if none is a frame's, or they look shifted by one.

    Frames after the loss of an unknown number of images have no number that is sure, and no mask.
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
    return MaskPairing((Times(range(frames), sure), folder), 0, unused, frames - sure)


def _meaning(pictures: LabelPictures, settings: MaskSettings, selection: Selection) -> Meaning:
    """Look at some masks: their size must fit, and their values be known."""
    confidence = None if settings.threshold is None else Confidence(settings.threshold)
    seen: list[int] = []
    problem, fractions = "", False
    for picture in samples(pictures):
        try:
            _check_size(picture, pictures.name, selection)
            if confidence is None:
                seen += seen_in(picture, settings.labels, pictures.name, pictures.limits)
            else:
                seen.append(int(confidence.read(picture, pictures.limits).max()))
                fractions |= holds_fractions(picture)
        except BadMessage as error:
            problem = problem or str(error)
    if not seen:
        raise LogError(f"{pictures.name}: nothing can be decoded: {problem or _problem(pictures)}")
    if confidence is None:
        return _understood(settings, seen, pictures.name)
    if max(seen) in _ONES:
        raise LogError(f"{pictures.name} holds only 0 and 1, as masks do: leave out the threshold")
    if 0 < max(seen) <= _BYTE and not fractions:
        raise LogError(
            f"{pictures.name} holds no confidence above {max(seen) / TOP:.4f}: whole numbers of 16 "
            "bits count as shares of 65535; write those from 0 to 255 with 8 bits"
        )
    return confidence


def _problem(pictures: LabelPictures) -> str:
    """Return why the first mask cannot be read."""
    try:
        pictures.picture(0)
    except FrameError as error:
        return str(error)
    return "it holds no mask"


def _understood(settings: MaskSettings, seen: list[int], name: str) -> Meaning:
    try:
        return understand(settings.labels, seen, name)
    except LogError as error:
        if len(set(seen)) <= _CLASSES:
            raise
        raise LogError(f"{error}; or, for confidences, their threshold") from error


def _check_size(picture: Picture, name: str, selection: Selection) -> None:
    size, wanted = size_of(picture), selection.image.size
    if selection.resize_truth or None in (size, wanted) or size == wanted:
        return
    ours, theirs = ("x".join(map(str, each or ())) for each in (wanted, size))
    raise LogError(
        f"{name} is {theirs}, but {selection.image.name} is {ours}: "
        "scale the labels with `topics.resize_truth`"
    )
