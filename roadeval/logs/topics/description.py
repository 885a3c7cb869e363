"""Descriptions of topics: kind, encoding, size, rate, gaps; and what is odd about their images."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.messages.pictures import RawPicture, codec_of, kind_of
from roadeval.logs.messages.pixels import lossy_format, raw_format, size_of, to_labels
from roadeval.logs.messages.video import Video
from roadeval.logs.settings import NS
from roadeval.logs.topics.reader import UNREADABLE, TopicReader

PROBES: Final = 3
"""Messages to try before a topic counts as undecodable."""
GAP: Final = 2.5
"""A step of more than so many median periods is a gap."""

Size = tuple[int, int]
"""Width and height."""


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """One topic of a log."""

    name: str
    schema: str
    """Its name."""
    encoding: str
    """Of the messages: ``cdr``, ``protobuf``, ..."""
    kind: TopicKind
    """What its messages carry, by the schema's name."""
    count: int
    """Messages that are in the log, readable or not."""
    first_ns: int | None = None
    last_ns: int | None = None
    """Log times of the first and the last message, None if there is none."""
    rate_hz: float | None = None
    """One over the median time between messages; None below two messages."""
    gaps: tuple[tuple[int, int], ...] = ()
    """Log times around each step of more than 2.5 median periods (for images only)."""
    format: str = ""
    """For images: the pixel encoding or file format of the first readable message."""
    size: tuple[int, int] | None = None
    """For images: width and height of it."""
    channels: int | None = None
    """For images: 1 if it is an image of single values, 3 if of colours."""
    lossy: str = ""
    """For images: the format of the first readable one if its compression changes values, as JPEG;
    else empty."""
    frame_id: str = ""
    """For images: the camera's name in the header of the first readable message, or empty."""
    problem: str = ""
    """Why no message could be decoded, or empty."""

    @property
    def is_image(self) -> bool:
        """Whether its messages carry images, as pixels, files or video."""
        return self.kind is not TopicKind.OTHER


def describe_topic(reader: TopicReader) -> TopicInfo:
    """Describe a topic from its messages' places and the first one that can be decoded."""
    first_channel = reader.channels[0]
    channel, schema = first_channel.channel, first_channel.schema
    logs = [source.log for source in reader.channels if source.log.count]
    count = sum(log.count for log in logs)
    first = min((log.first_ns for log in logs), default=None)
    last = max((log.last_ns for log in logs), default=None)
    times = reader.log_times
    period, rate = median_period(times), None
    if period > 0:
        rate = NS / period
    # Of a topic that is not read, only the number of messages and their time range are known.
    elif count > 1 and first is not None and last is not None and last > first:
        rate = (count - 1) * NS / (last - first)
    before = np.flatnonzero(np.diff(times) > GAP * period) if period > 0 else ()
    topic = TopicInfo(
        name=reader.name,
        schema=schema.name if schema else "",
        encoding=channel.message_encoding,
        kind=kind_of(channel, schema),
        count=count,
        first_ns=first,
        last_ns=last,
        rate_hz=rate,
        gaps=tuple((int(times[i]), int(times[i + 1])) for i in before),
    )
    return _with_picture(topic, reader) if topic.is_image else topic


def median_period(log_times: npt.NDArray[np.int64]) -> int:
    """Return the median time between messages in nanoseconds; 0 below two messages."""
    return int(np.median(np.diff(log_times))) if len(log_times) > 1 else 0


def _with_picture(topic: TopicInfo, reader: TopicReader) -> TopicInfo:
    """Add what the first messages show; without a schema, they alone show whether it is images."""
    problem, tried = "", 0
    for position in range(len(reader)):
        try:
            return replace(topic, **_shown_by(reader, position))
        except (FrameError, BadMessage) as error:
            problem = problem or str(error)
        tried += not reader.is_lost(position)
        if tried == PROBES:
            break
    return replace(topic, problem=problem) if topic.schema else replace(topic, kind=TopicKind.OTHER)


def _shown_by(reader: TopicReader, position: int) -> dict[str, Any]:
    """Return the fields of a `TopicInfo` that a message shows."""
    picture = reader.picture(position)
    if isinstance(picture, RawPicture):
        return {
            "kind": TopicKind.IMAGE,
            "format": picture.encoding,
            "size": (picture.width, picture.height),
            "channels": 1 if raw_format(picture, reader.limits).is_grey else 3,
            "frame_id": picture.frame_id,
        }
    found = {"lossy": lossy_format(picture), "frame_id": picture.frame_id}
    if (codec := codec_of(picture)) is not None:
        try:
            pixels = Video(reader, reader.limits).picture(0).pixels
            size = pixels.shape[1], pixels.shape[0]
        except (FrameError, LogError):  # the first frame cannot be decoded
            size = None
        return found | {"kind": TopicKind.VIDEO, "format": codec, "size": size, "channels": 3}
    pixels = to_labels(picture, reader.limits)
    return found | {
        "kind": TopicKind.COMPRESSED,
        "format": picture.format,
        "size": (pixels.shape[1], pixels.shape[0]),
        "channels": 1 if pixels.ndim == 2 else 3,
    }


# --- Oddities of a topic's images -----------------------------------------------------------------


def survey(reader: TopicReader, size: Size | None) -> tuple[str, ...]:
    """Go through all messages of a topic whose images have this size; return what is odd."""
    positions = range(len(reader))
    stamps = np.array([reader.stamp(position) for position in positions], np.int64)
    sizes = {}
    for position in positions if size else ():
        with suppress(FrameError, BadMessage):
            if (found := size_of(reader.picture(position))) not in (None, size):
                sizes[position] = found
    return oddities(reader, size, positions, stamps, sizes)


def oddities(
    reader: TopicReader,
    size: Size | None,
    positions: Sequence[int],
    stamps: npt.NDArray[np.int64],
    others: Mapping[int, Size],
) -> tuple[str, ...]:
    """Return what is odd about the images at some positions, a sentence each.

    ``others`` holds the sizes, by position, of images of another size than the topic's.
    """
    found, total = [], len(positions)
    if others and size is not None:
        counts = Counter(others.values()).most_common()
        listed = ", ".join(f"{count} of {width}x{height}" for (width, height), count in counts)
        found.append(
            f"not all of the {total} images are {size[0]}x{size[1]}: {listed}, from frame "
            f"{min(others)} on"
        )
    if repeated := _repeats(reader, positions, stamps):
        found.append(
            f"{repeated} of the {total} images repeat an earlier one, by stamp and content; each "
            "of them is counted"
        )
    return tuple(found)


def _repeats(reader: TopicReader, positions: Sequence[int], stamps: npt.NDArray[np.int64]) -> int:
    """Count the messages that repeat an earlier one: the same stamp, and the same bytes."""
    order = np.argsort(stamps, kind="stable")
    same = np.diff(stamps[order]) == 0
    repeated = 0
    for group in np.split(order, np.flatnonzero(~same) + 1):
        if len(group) > 1 and stamps[group[0]] != UNREADABLE:
            contents = []
            for place in group:
                with suppress(FrameError):
                    contents.append(bytes(reader.message(positions[place]).data))
            repeated += len(contents) - len(set(contents))
    return repeated
