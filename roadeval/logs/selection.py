"""The selection: which topics of a log are replayed, and by which rules, before the first frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.messages.pixels import to_rgb
from roadeval.logs.settings import LabelSettings, LogConfig
from roadeval.logs.topics.choose import Choice, choose_image, choose_shadow, choose_truth, named
from roadeval.logs.topics.description import TopicInfo
from roadeval.logs.topics.reader import TopicReader
from roadeval.logs.truth.pairing import Camera, Clock
from roadeval.logs.truth.source import LabelSource, check_size, in_log, nothing_of, samples


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """Topics and rules of a replay."""

    camera: Camera
    """The camera's images, and how labels are paired with them."""
    image_why: str
    """Why that camera."""
    truth: LabelSource | None
    """Road truth."""
    shadow: LabelSource | None
    """Truth of shadow."""
    masks: Mapping[str, LabelSource]
    """Other systems' road masks by name: those in the log, then those beside it."""
    scale: float = 1.0
    """Scale of the frames that are read, relative to the camera's; at most 1."""
    no_truth: str = ""
    """Why there is no road truth; empty if there is."""

    @property
    def image(self) -> TopicInfo:
        """The camera's topic."""
        return self.camera.topic

    def digests(self) -> dict[str, str]:
        """Return the SHA-256 of the masks that do not lie in the log, by name."""
        return {name: each.digest() for name, each in self.masks.items() if each.digest}

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height of the frames that are read, if known."""
        return None if self.image.size is None else scaled_size(self.image.size, self.scale)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Which topics were chosen and why, a sentence each."""
        lines = [f"image: {self.image.name} ({self.image_why})"]
        sources = {"truth": self.truth, "shadow truth": self.shadow}
        sources |= {f"mask {name}": source for name, source in self.masks.items()}
        for name, source in sources.items():
            if source is not None:
                words = source.meaning.words
                if source is self.shadow:
                    words = words.replace("road is", "shadow is")
                lines.append(f"{name}: {source.where} ({source.why}; {words})")
        if self.no_truth:
            lines.append(f"no truth: {self.no_truth}")
        if (clock := self.camera.clock) is not Clock.STAMP:
            lines.append(f"the header stamps are all zero or equal: {clock} take their place")
        return tuple(lines)


def scaled_size(size: tuple[int, int], scale: float) -> tuple[int, int]:
    """Scale a width and height, to whole pixels."""
    width, height = (max(1, round(length * scale)) for length in size)
    return width, height


def settle(
    topics: Sequence[TopicInfo],
    readers: Mapping[str, TopicReader],
    config: LogConfig,
    *,
    several: bool = False,
) -> Selection:
    """Settle what to replay of these topics, but for what lies beside the log.

    Raises
    ------
    LogError
        As `roadeval.logs.Log.select` says.
    """
    asked, labels = config.topics, config.labels
    image, why = choose_image(topics, asked.image)
    _check_readable(readers[image.name], image)
    truth = choose_truth(topics, image, asked.truth, labels)
    shadow = choose_shadow(topics, image, asked.shadow, labels)
    masks = {
        name: Choice(named(topics, topic, f"`topics.masks` {name}"), "asked for")
        for name, topic in asked.masks.items()
    }
    # What would be scored against itself is refused.
    if truth.topic == image:
        raise LogError(f"`topics.truth` {image.name}: it is the image's own topic")
    for name, mask in masks.items():
        if mask.topic == truth.topic:
            raise LogError(
                f"`topics.masks` {name}: {asked.masks[name]} is the truth that it is held against"
            )
    camera = Camera.of(
        readers[image.name], image, asked.sync_tolerance_ms, resize_labels=asked.resize_truth
    )

    def source(choice: Choice, labels: LabelSettings) -> LabelSource | None:
        if choice.topic is None:
            return None
        check_size(choice.topic.name, choice.topic.size, camera)
        return in_log(readers[choice.topic.name], choice.why, labels, camera, several=several)

    masks_only = LabelSettings(tolerance=labels.tolerance)
    found = {name: source(mask, masks_only) for name, mask in masks.items()}
    return Selection(
        camera,
        why,
        truth=source(truth, labels),
        shadow=source(shadow, masks_only),
        masks={name: each for name, each in found.items() if each is not None},
        scale=config.frames.scale,
        no_truth="" if truth.topic else truth.why,
    )


def _check_readable(reader: TopicReader, topic: TopicInfo) -> None:
    """Refuse, as a `LogError`, a topic of which nothing can be decoded.

    Neither its first messages nor some spread over the log.
    """
    if not topic.problem:
        return
    for picture in samples(reader):
        with suppress(BadMessage):
            to_rgb(picture, reader.limits)
            return
    raise nothing_of(reader, topic.problem)
