"""The selection: which topics of a log are replayed, and by which rules, before the first frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.messages.pixels import to_rgb
from roadeval.logs.settings import LabelSettings, LogConfig, MaskSettings
from roadeval.logs.topics.choose import Choice, choose_image, choose_shadow, choose_truth, named
from roadeval.logs.topics.description import TopicInfo
from roadeval.logs.topics.reader import TopicReader
from roadeval.logs.truth.pairing import Camera, Clock
from roadeval.logs.truth.source import LabelSource, check_size, in_log, nothing_of, samples

TRUTH: Final = "/truth"
SHADOW: Final = "/shadow"
"""Names of road truth and true shadow among labels; no mask's name begins with a slash."""


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """Topics and rules of a replay."""

    camera: Camera
    """The camera's images, and how labels are paired with them."""
    image_why: str
    """Why that camera."""
    labels: Mapping[str, LabelSource]
    """`TRUTH`, `SHADOW`, and other systems' road masks by name, those in the log first."""
    scale: float = 1.0
    """Scale of the frames that are read, relative to the camera's; at most 1."""
    no_truth: str = ""
    """Why there is no road truth; empty if there is."""

    @property
    def image(self) -> TopicInfo:
        """The camera's topic."""
        return self.camera.topic

    @property
    def truth(self) -> LabelSource | None:
        """Road truth."""
        return self.labels.get(TRUTH)

    @property
    def shadow(self) -> LabelSource | None:
        """Truth of shadow."""
        return self.labels.get(SHADOW)

    @property
    def masks(self) -> dict[str, LabelSource]:
        """Other systems' road masks by name."""
        return {name: each for name, each in self.labels.items() if name not in (TRUTH, SHADOW)}

    def digests(self) -> dict[str, str]:
        """Return the SHA-256 of labels that are not in the log: of ``truth``, and masks by name."""
        return {
            name.removeprefix("/"): each.digest()
            for name, each in self.labels.items()
            if each.digest
        }

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height of the frames that are read, if known."""
        return None if self.image.size is None else scaled_size(self.image.size, self.scale)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Which topics were chosen and why, a sentence each."""
        lines = [f"image: {self.image.name} ({self.image_why})"]
        for name, source in self.labels.items():
            what = {TRUTH: "truth", SHADOW: "shadow truth"}.get(name, f"mask {name}")
            words = source.meaning.words
            if name == SHADOW:
                words = words.replace("road is", "shadow is")
            lines.append(f"{what}: {source.where} ({source.why}; {words})")
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
    """Settle what to replay of a log's own topics.

    Raises
    ------
    LogError
        As `roadeval.logs.Log.select` says.
    """
    asked = config.topics
    image, why = choose_image(topics, asked.image)
    if image.problem:
        _check_readable(readers[image.name], image)
    if config.truth.path:
        truth = Choice(None, "")
    else:
        truth = choose_truth(topics, image, asked.truth, config.labels)
    choices = {TRUTH: truth, SHADOW: choose_shadow(topics, image, asked.shadow, config.labels)}
    for name, topic in asked.masks.items():
        choices[name] = Choice(named(topics, topic, f"`topics.masks` {name}"), "asked for")
    # What would be scored against itself is refused.
    if truth.topic == image:
        raise LogError(f"`topics.truth` {image.name}: it is the image's own topic")
    for name, topic in asked.masks.items():
        if choices[name].topic == truth.topic:
            raise LogError(f"`topics.masks` {name}: {topic} is the truth that it is scored against")
    camera = Camera.of(readers[image.name], image, asked)
    masks_only = LabelSettings(tolerance=config.labels.tolerance)
    labels = {}
    for name, (chosen, reason) in choices.items():
        if chosen is not None:
            check_size(chosen.name, chosen.size, camera)
            own = MaskSettings(labels=config.labels if name == TRUTH else masks_only)
            reader = readers[chosen.name]
            labels[name] = in_log(reader, own, camera, reason, several=several)
    no_truth = "" if truth.topic else truth.why
    return Selection(camera, why, labels, config.frames.scale, no_truth)


def _check_readable(reader: TopicReader, topic: TopicInfo) -> None:
    """Refuse, as a `LogError`, a topic of whose sampled messages none can be decoded."""
    for _, picture in samples(reader):
        with suppress(BadMessage):
            to_rgb(picture, reader.limits)
            return
    raise nothing_of(reader, topic.problem)
