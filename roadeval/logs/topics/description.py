"""Descriptions of topics: kind, encoding, size, rate, gaps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.messages.decoders import kind_of
from roadeval.logs.messages.pictures import CompressedPicture, RawPicture, codec_of
from roadeval.logs.messages.pixels import lossy_format, raw_format, to_labels
from roadeval.logs.messages.schemas import TopicKind
from roadeval.logs.messages.video import Video
from roadeval.logs.times import NS
from roadeval.logs.topics.reader import TopicReader

PROBES: Final = 3
"""Messages to try before a topic counts as undecodable."""
GAP: Final = 2.5
"""A step of more than so many median periods is a gap."""


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """One topic of a log.

    Parameters
    ----------
    name, schema, encoding
        Topic, schema's name, and encoding of the messages (``cdr``, ``protobuf``, ...).
    kind
        What its messages carry, by the schema's name.
    count
        Messages that are in the log, readable or not.
    first_ns, last_ns
        Log times of the first and the last message, None if there is none.
    rate_hz
        One over the median time between messages; None below two messages.
    gaps
        Log times around each step of more than 2.5 median periods (for images only).
    format
        For images: the pixel encoding or file format of the first readable message.
    size
        For images: width and height of it.
    channels
        For images: 1 if it is an image of single values, 3 if of colours.
    lossy
        For images: the format of the first readable one if its compression changes values, as
        JPEG; else empty.
    frame_id
        For images: the camera's name in the header of the first readable message, or empty.
    problem
        Why no message could be decoded, or empty.
    """

    name: str
    schema: str
    encoding: str
    kind: TopicKind
    count: int
    first_ns: int | None = None
    last_ns: int | None = None
    rate_hz: float | None = None
    gaps: tuple[tuple[int, int], ...] = ()
    format: str = ""
    size: tuple[int, int] | None = None
    channels: int | None = None
    lossy: str = ""
    frame_id: str = ""
    problem: str = ""

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
    problem = ""
    for position in range(min(PROBES, len(reader))):
        try:
            return replace(topic, **_look(reader, position))
        except (FrameError, BadMessage) as error:
            problem = problem or str(error)
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
