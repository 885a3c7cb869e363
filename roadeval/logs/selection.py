"""What of a log is to be replayed, settled before the first frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.logs.choose import choose_image, choose_shadow, choose_truth, named
from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.labels import LabelMap, LabelValues, understand
from roadeval.logs.messages import BadMessage
from roadeval.logs.pixels import to_labels
from roadeval.logs.topics import TopicInfo, median_period
from roadeval.logs.track import UNREADABLE, Track

LOOKED_AT: Final = 10
"""Label images at the log's start, and as many spread over it, that settle what values mean."""


@dataclass(frozen=True, slots=True)
class LabelTopic:
    """A topic of label images, how its values are understood, and why it was chosen."""

    topic: TopicInfo
    labels: LabelMap
    why: str


@dataclass(frozen=True, slots=True)
class Selection:
    """Topics and rules of a replay.

    Parameters
    ----------
    image, image_why
        The camera's topic, and why that one.
    truth, shadow, masks
        Road truth, truth of shadow, and other systems' road masks by name.
    tolerance_ns
        Largest difference of the header stamps of an image and its label.
    stamped
        Whether the images have header stamps; else log times take their place.
    resize_truth
        Whether label images of another size are scaled to the image's (nearest neighbour).
    notes
        Sentences for a person: every choice that was made, and why.
    """

    image: TopicInfo
    image_why: str
    truth: LabelTopic | None
    shadow: LabelTopic | None
    masks: Mapping[str, LabelTopic]
    tolerance_ns: int
    stamped: bool = True
    resize_truth: bool = False
    notes: tuple[str, ...] = field(default=())

    @property
    def reasons(self) -> tuple[str, ...]:
        """One sentence a topic: what was picked and why."""
        lines = [f"image: {self.image.name} ({self.image_why})"]
        named = {"truth": self.truth, "shadow truth": self.shadow}
        named |= {f"mask {name}": topic for name, topic in self.masks.items()}
        lines += [
            f"{name}: {label.topic.name} ({label.why}; {label.labels.words})"
            for name, label in named.items()
            if label
        ]
        return (*lines, *self.notes)


@dataclass(frozen=True, slots=True)
class Asked:
    """What the user said about topics and labels; see `roadeval.logs.Log.select`."""

    image: str | None
    truth: str | None
    shadow: str | None
    masks: Mapping[str, str]
    labels: LabelValues
    tolerance_ns: int | None
    resize: bool


def settle(topics: Sequence[TopicInfo], tracks: Mapping[str, Track], asked: Asked) -> Selection:
    """Settle what to replay of these topics.

    Raises
    ------
    LogError
        As `roadeval.logs.Log.select` says.
    """
    image, why = choose_image(topics, asked.image)

    def label(chosen: tuple[TopicInfo | None, str], labels: LabelValues) -> LabelTopic | None:
        topic, why = chosen
        if topic is None:
            return None
        meaning = look_at_labels(tracks[topic.name], topic, image, labels, resize=asked.resize)
        return LabelTopic(topic, meaning, why)

    truth = choose_truth(topics, image, asked.truth)
    shadow = choose_shadow(topics, image, asked.shadow)
    masks = {
        name: (named(topics, topic, f"--mask-topic {name}"), "asked for")
        for name, topic in asked.masks.items()
    }
    track = tracks[image.name]
    stamped = is_stamped(track)
    return Selection(
        image,
        why,
        label(truth, asked.labels),
        label(shadow, LabelValues()),
        {name: found for name, mask in masks.items() if (found := label(mask, LabelValues()))},
        tolerance(track.log_times, asked.tolerance_ns),
        stamped,
        asked.resize,
        _notes(truth, stamped=stamped),
    )


def _notes(truth: tuple[TopicInfo | None, str], *, stamped: bool) -> tuple[str, ...]:
    notes = []
    if truth[0] is None:
        notes.append(f"no truth: {truth[1]}")
    if not stamped:
        notes.append("the header stamps are all zero: log times take their place")
    return tuple(notes)


def look_at_labels(
    track: Track, topic: TopicInfo, image: TopicInfo, labels: LabelValues, *, resize: bool
) -> LabelMap:
    """Look at some label images: settle what their values mean, and that their size fits.

    Raises
    ------
    LogError
        If the size differs and ``resize`` is off, or the values cannot be understood.
    """
    seen: set[int] = set()
    for pixels in _samples(track):
        if not resize:
            check_size(pixels, image.size, topic.name, image.name)
        seen |= values_of(pixels, topic.name)
    return understand(labels, seen, topic.name)


def values_of(pixels: npt.NDArray[Any], name: str) -> set[int]:
    """Values that occur in a label image.

    Raises
    ------
    LogError
        If it holds colours.
    """
    if pixels.ndim != 2:
        raise LogError(f"{name} holds colours, not label values")
    return set(np.flatnonzero(np.bincount(pixels.ravel())).tolist())


def check_size(
    pixels: npt.NDArray[Any], size: tuple[int, int] | None, name: str, image: str
) -> None:
    """Refuse a label image of another size than the camera's.

    Raises
    ------
    LogError
        If it is.
    """
    height, width = pixels.shape[:2]
    if size is not None and (width, height) != size:
        raise LogError(
            f"{name} is {width}x{height}, but {image} is {size[0]}x{size[1]}: "
            "scale the labels with --resize-truth"
        )


def is_stamped(track: Track) -> bool:
    """Whether any of a topic's first messages has a header stamp other than zero."""
    stamps = (track.stamp(position) for position in range(len(track)))
    known = [stamp for stamp in islice(stamps, LOOKED_AT) if stamp != UNREADABLE]
    return not known or any(known)


def tolerance(log_times: npt.NDArray[np.int64], asked_ns: int | None) -> int:
    """Nanoseconds asked for, or else half the frame period."""
    return median_period(log_times) // 2 if asked_ns is None else asked_ns


def _samples(track: Track) -> Iterator[npt.NDArray[Any]]:
    """Decode the first label images and some spread over the rest."""
    first = range(min(LOOKED_AT, len(track)))
    spread = np.linspace(0, max(len(track) - 1, 0), LOOKED_AT, dtype=int).tolist()
    for position in _unique((*first, *spread)):
        try:
            yield to_labels(track.picture(position))
        except (FrameError, BadMessage):
            continue


def _unique(positions: Iterable[int]) -> list[int]:
    return sorted(set(positions))
