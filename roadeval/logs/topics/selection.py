"""The selection: which topics of a log are replayed, and by which rules, before the first frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Final

import numpy as np

from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.messages.pixels import to_rgb
from roadeval.logs.messages.video import PictureSequence
from roadeval.logs.scaling import scaled_size
from roadeval.logs.settings import LabelSettings, TopicSettings
from roadeval.logs.topics.choose import (
    Choice,
    choose_image,
    choose_shadow,
    choose_truth,
    named,
)
from roadeval.logs.topics.description import TopicInfo, median_period
from roadeval.logs.topics.label_map import LabelMap
from roadeval.logs.topics.label_meaning import understand
from roadeval.logs.topics.labels import seen_in
from roadeval.logs.topics.pairing import UNREADABLE
from roadeval.logs.topics.reader import TopicReader

if TYPE_CHECKING:
    from roadeval.logs.topics.mask_source import MaskSource

ALONE_NS: Final = 50_000_000
"""Half the period of a camera of 10 Hz."""
LOOKED_AT: Final = 10
"""Label images at the log's start, and as many spread over it, that settle what values mean."""


class Clock(StrEnum):
    """By what images and labels are paired."""

    STAMP = "header stamps"
    LOG_TIME = "log times"
    ORDER = "their order"


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
    elsewhere
        Their masks that do not lie in the log, by name.
    no_truth
        Why there is no road truth; empty if there is.
    tolerance_ns
        Largest difference of the header stamps of an image and its label.
    clock
        By what images and labels are paired: header stamps if they differ, else log times, else
        their order.
    resize_truth
        Whether label images of another size are scaled to the image's (nearest neighbour).
    scale
        Scale of the frames that are read, relative to the camera's; at most 1.
    """

    image: TopicInfo
    image_why: str
    truth: LabelTopic | None
    shadow: LabelTopic | None
    masks: Mapping[str, LabelTopic]
    tolerance_ns: int
    clock: Clock = Clock.STAMP
    resize_truth: bool = False
    scale: float = 1.0
    no_truth: str = ""
    elsewhere: Mapping[str, MaskSource] = field(default_factory=dict)

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height of the frames that are read, if known."""
        return None if self.image.size is None else scaled_size(self.image.size, self.scale)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Which topics were chosen and why, a sentence each."""
        lines = [f"image: {self.image.name} ({self.image_why})"]
        named = {"truth": self.truth, "shadow truth": self.shadow}
        named |= {f"mask {name}": topic for name, topic in self.masks.items()}
        for name, label in named.items():
            if label:
                words = label.labels.words
                if label is self.shadow:
                    words = words.replace("road is", "shadow is")
                lines.append(f"{name}: {label.topic.name} ({label.why}; {words})")
        for name, mask in self.elsewhere.items():
            lines.append(f"mask {name}: {mask.where} ({mask.why}; {mask.meaning.words})")
        if self.no_truth:
            lines.append(f"no truth: {self.no_truth}")
        if self.clock is not Clock.STAMP:
            lines.append(f"the header stamps are all zero or equal: {self.clock} take their place")
        return tuple(lines)


def settle(
    topics: Sequence[TopicInfo],
    readers: Mapping[str, TopicReader],
    asked: TopicSettings,
    labels: LabelSettings,
    scale: float,
    *,
    several: bool = False,
) -> Selection:
    """Settle what to replay of these topics.

    Raises
    ------
    LogError
        As `roadeval.logs.Log.select` says.
    """
    image, why = choose_image(topics, asked.image)
    images = readers[image.name]
    check_readable(images, image)
    truth = choose_truth(topics, image, asked.truth, labels)
    shadow = choose_shadow(topics, image, asked.shadow, labels)
    masks_only = LabelSettings(tolerance=labels.tolerance)
    masks = {
        name: Choice(named(topics, topic, f"`topics.masks` {name}"), "asked for")
        for name, topic in asked.masks.items()
    }
    _check_roles(image, truth, {f"`topics.masks` {name}": mask for name, mask in masks.items()})
    look = partial(_label_topic, readers, image, resize=asked.resize_truth, several=several)
    return Selection(
        image=image,
        image_why=why,
        truth=look(truth, labels),
        shadow=look(shadow, masks_only),
        masks={name: label for name, mask in masks.items() if (label := look(mask, masks_only))},
        tolerance_ns=tolerance(images, asked.sync_tolerance_ms),
        clock=clock_of(images),
        resize_truth=asked.resize_truth,
        scale=scale,
        no_truth="" if truth.topic else truth.why,
    )


def _check_roles(image: TopicInfo, truth: Choice, masks: Mapping[str, Choice]) -> None:
    """Refuse, as a `LogError`, what would be scored against itself."""
    if truth.topic == image:
        raise LogError(f"`topics.truth` {image.name}: it is the image's own topic")
    for setting, mask in masks.items():
        if truth.topic is not None and mask.topic == truth.topic:
            raise LogError(f"{setting}: {truth.topic.name} is the truth that it is held against")


def _label_topic(
    readers: Mapping[str, TopicReader],
    image: TopicInfo,
    choice: Choice,
    labels: LabelSettings,
    *,
    resize: bool,
    several: bool,
) -> LabelTopic | None:
    """Look at some images of the chosen topic: their size must fit, and their values be known."""
    topic = choice.topic
    if topic is None:
        return None
    if not resize and topic.size and image.size and topic.size != image.size:
        sizes = ["x".join(map(str, size)) for size in (topic.size, image.size)]
        raise LogError(
            f"{topic.name} is {sizes[0]}, but {image.name} is {sizes[1]}: "
            "scale the labels with `topics.resize_truth`"
        )
    reader, seen, problem = readers[topic.name], list[int](), ""
    for picture in samples(reader):
        try:
            seen += seen_in(picture, labels, topic.name, reader.limits)
        except BadMessage as error:
            problem = problem or str(error)
    if not seen:
        raise LogError(_nothing(topic, problem))
    meaning = understand(labels, seen, topic.name, several=several)
    return LabelTopic(topic, meaning, choice.why)


def check_readable(reader: TopicReader, topic: TopicInfo) -> None:
    """Refuse a topic of which nothing can be decoded.

    Raises
    ------
    LogError
        If neither the first messages nor some spread over the log can be.
    """
    if not topic.problem:
        return
    for picture in samples(reader):
        with suppress(BadMessage):
            to_rgb(picture, reader.limits)
            return
    raise LogError(_nothing(topic, topic.problem))


def _nothing(topic: TopicInfo, problem: str) -> str:
    why = problem or topic.problem or "its messages cannot be read"
    return f"nothing of {topic.name} can be decoded: {why}"


def clock_of(reader: TopicReader) -> Clock:
    """Return what differs among the first images of a topic."""
    stamps = (reader.stamp(position) for position in range(len(reader)))
    known = list(islice((stamp for stamp in stamps if stamp != UNREADABLE), LOOKED_AT))
    if len(set(known)) > 1 or (len(known) == 1 and any(known)):
        return Clock.STAMP
    times = reader.log_times[:LOOKED_AT]
    return Clock.LOG_TIME if len(times) <= 1 or times[0] != times[-1] else Clock.ORDER


def tolerance(reader: TopicReader, asked_ms: float | None) -> int:
    """Return the tolerance asked for, or else half the frame period, in nanoseconds.

    An image alone has no period; what is within `ALONE_NS` of it belongs to it.
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


def samples(reader: PictureSequence) -> Iterator[Picture]:
    """Read the first images of a topic, or of a folder, and some spread over the rest."""
    if not len(reader):
        return
    spread = np.linspace(0, max(len(reader) - 1, 0), LOOKED_AT, dtype=int).tolist()
    for position in sorted({*range(min(LOOKED_AT, len(reader))), *spread}):
        with suppress(FrameError):
            yield reader.picture(position)
