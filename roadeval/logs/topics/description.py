"""Descriptions of topics: kind, encoding, size, rate, gaps; and what is odd about their images."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.messages.pictures import CompressedPicture, RawPicture, codec_of, kind_of
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
    topic = TopicInfo(
        name=reader.name,
        schema=schema.name if schema else "",
        encoding=channel.message_encoding,
        kind=kind_of(channel, schema),
        count=sum(log.count for log in logs),
        first_ns=min((log.first_ns for log in logs), default=None),
        last_ns=max((log.last_ns for log in logs), default=None),
        gaps=_gaps(reader.log_times),
    )
    topic = replace(topic, rate_hz=_rate(reader.log_times, topic))
    return _with_picture(topic, reader) if topic.is_image else topic


def median_period(log_times: npt.NDArray[np.int64]) -> int:
    """Median time between messages in nanoseconds; 0 below two messages."""
    return int(np.median(np.diff(log_times))) if len(log_times) > 1 else 0


def _rate(log_times: npt.NDArray[np.int64], topic: TopicInfo) -> float | None:
    period = median_period(log_times)
    if period > 0:
        return NS / period
    # Of a topic that is not read, only the number of messages and their time range are known.
    first, last = topic.first_ns, topic.last_ns
    if topic.count > 1 and first is not None and last is not None and last > first:
        return (topic.count - 1) * NS / (last - first)
    return None


def _gaps(log_times: npt.NDArray[np.int64]) -> tuple[tuple[int, int], ...]:
    period = median_period(log_times)
    if period <= 0:
        return ()
    before = np.flatnonzero(np.diff(log_times) > GAP * period)
    return tuple((int(log_times[i]), int(log_times[i + 1])) for i in before)


def _with_picture(topic: TopicInfo, reader: TopicReader) -> TopicInfo:
    """Add what the first messages show; without a schema, they alone show whether it is images."""
    problem, tried = "", 0
    for position in range(len(reader)):
        try:
            return replace(topic, **_look(reader, position))
        except (FrameError, BadMessage) as error:
            problem = problem or str(error)
        tried += not reader.is_lost(position)
        if tried == PROBES:
            break
    return replace(topic, problem=problem) if topic.schema else replace(topic, kind=TopicKind.OTHER)


def _look(reader: TopicReader, position: int) -> dict[str, Any]:
    """Return the fields of a `TopicInfo` that a message shows."""
    picture = reader.picture(position)
    if isinstance(picture, RawPicture):
        channels = 1 if raw_format(picture, reader.limits).is_grey else 3
        return {
            "kind": TopicKind.IMAGE,
            "format": picture.encoding,
            "size": (picture.width, picture.height),
            "channels": channels,
            "frame_id": picture.frame_id,
        }
    found = {"kind": TopicKind.COMPRESSED, "lossy": lossy_format(picture)}
    if isinstance(picture, CompressedPicture):
        found["frame_id"] = picture.frame_id
    codec = codec_of(picture)
    if codec is not None:
        size = _video_size(reader)
        return found | {"kind": TopicKind.VIDEO, "format": codec, "size": size, "channels": 3}
    pixels = to_labels(picture, reader.limits)
    return found | {
        "format": picture.format if isinstance(picture, CompressedPicture) else "",
        "size": (pixels.shape[1], pixels.shape[0]),
        "channels": 1 if pixels.ndim == 2 else 3,
    }


def _video_size(reader: TopicReader) -> tuple[int, int] | None:
    """Return the size of the first frame, or None where video cannot be decoded."""
    try:
        pixels = Video(reader, reader.limits).picture(0).pixels
    except (FrameError, LogError):
        return None
    return pixels.shape[1], pixels.shape[0]


def survey(reader: TopicReader, size: Size | None) -> tuple[str, ...]:
    """Go through all messages of a topic whose images are of a size; return what is odd."""
    positions = range(len(reader))
    stamps = np.array([reader.stamp(position) for position in positions], np.int64)
    repeated = repeats(reader, positions, stamps)
    sizes = dict(_other_sizes(reader, size)) if size else {}
    return (*tell_sizes(sizes, len(reader), size), *tell_repeats(repeated, len(reader)))


def repeats(reader: TopicReader, positions: Sequence[int], stamps: npt.NDArray[np.int64]) -> int:
    """Count the messages that repeat an earlier one: the same stamp, and the same bytes."""
    order = np.argsort(stamps, kind="stable")
    same = np.diff(stamps[order]) == 0
    groups = np.split(order, np.flatnonzero(~same) + 1)
    return sum(
        _repeats_in(reader, [positions[i] for i in group])
        for group in groups
        if len(group) > 1 and stamps[group[0]] != UNREADABLE
    )


def _repeats_in(reader: TopicReader, positions: Iterable[int]) -> int:
    contents = []
    for position in positions:
        try:
            contents.append(bytes(reader.message(position).data))
        except FrameError:
            continue
    return len(contents) - len(set(contents))


def _other_sizes(reader: TopicReader, size: Size) -> Iterable[tuple[int, Size]]:
    """Yield the positions of images of another size, by what their heads say."""
    for position in range(len(reader)):
        try:
            found = size_of(reader.picture(position))
        except (FrameError, BadMessage):
            continue
        if found not in (None, size):
            yield position, found


def tell_sizes(others: Mapping[int, Size], total: int, size: Size | None) -> tuple[str, ...]:
    """Say that images of other sizes, by frame number, are among the ``total``; if they are."""
    if not others or size is None:
        return ()
    counts = Counter(others.values()).most_common()
    listed = ", ".join(f"{count} of {width}x{height}" for (width, height), count in counts)
    return (
        f"not all of the {total} images are {size[0]}x{size[1]}: {listed}, from frame "
        f"{min(others)} on",
    )


def tell_repeats(repeated: int, total: int) -> tuple[str, ...]:
    """Say that images are repeated, if they are."""
    if not repeated:
        return ()
    return (
        f"{repeated} of the {total} images repeat an earlier one, by stamp and content: each is "
        "counted as often as it is there",
    )
