"""What the topics of a log are: kind, encoding, size, rate, gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.logs.container.file import Container
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.messages.pictures import CompressedPicture, Kind, RawPicture, codec_of, kind_of
from roadeval.logs.messages.pixels import to_labels
from roadeval.logs.messages.raw import layout_of
from roadeval.logs.messages.video import Video
from roadeval.logs.topics.span import NS
from roadeval.logs.topics.track import Source, Track

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
    problem
        Why no message could be decoded, or empty.
    """

    name: str
    schema: str
    encoding: str
    kind: Kind
    count: int
    first_ns: int | None = None
    last_ns: int | None = None
    rate_hz: float | None = None
    gaps: tuple[tuple[int, int], ...] = ()
    format: str = ""
    size: tuple[int, int] | None = None
    channels: int | None = None
    problem: str = ""

    @property
    def is_image(self) -> bool:
        """Whether its messages carry images, as pixels, files or video."""
        return self.kind is not Kind.OTHER


def describe_topic(name: str, sources: Sequence[Source], track: Track) -> TopicInfo:
    """Describe a topic from its messages' places and the first one that can be decoded."""
    container, channel_id = sources[0].container, sources[0].channel_id
    channel = container.channels[channel_id]
    schema = container.schemas.get(channel.schema_id)
    logs = [s.container.logs[s.channel_id] for s in sources if s.channel_id in s.container.logs]
    logs = [log for log in logs if log.count]
    first = min((log.first_ns for log in logs), default=None)
    last = max((log.last_ns for log in logs), default=None)
    count = sum(log.count for log in logs)
    kind = kind_of(channel, schema)
    look = _Look(kind)
    if kind is not Kind.OTHER:
        look = _probe(track, kind, named=schema is not None)
    return TopicInfo(
        name,
        schema.name if schema else "",
        channel.message_encoding,
        look.kind,
        count,
        first,
        last,
        _rate(track.log_times, first, last, count),
        _gaps(track.log_times),
        look.format,
        look.size,
        look.channels,
        look.problem,
    )


def median_period(log_times: npt.NDArray[np.int64]) -> int:
    """Median time between messages in nanoseconds; 0 below two messages."""
    return int(np.median(np.diff(log_times))) if len(log_times) > 1 else 0


def _rate(
    log_times: npt.NDArray[np.int64], first: int | None, last: int | None, count: int
) -> float | None:
    period = median_period(log_times)
    if period > 0:
        return NS / period
    if count > 1 and first is not None and last is not None and last > first:
        return (count - 1) * NS / (last - first)
    return None


def _gaps(log_times: npt.NDArray[np.int64]) -> tuple[tuple[int, int], ...]:
    period = median_period(log_times)
    if period <= 0:
        return ()
    before = np.flatnonzero(np.diff(log_times) > GAP * period)
    return tuple((int(log_times[i]), int(log_times[i + 1])) for i in before)


@dataclass(frozen=True, slots=True)
class _Look:
    kind: Kind
    format: str = ""
    size: tuple[int, int] | None = None
    channels: int | None = None
    problem: str = ""


def _probe(track: Track, kind: Kind, *, named: bool) -> _Look:
    """Look at the first messages; without a schema's name they alone tell what they are."""
    problem = ""
    for position in range(min(PROBES, len(track))):
        try:
            return _look(track, position)
        except (FrameError, BadMessage) as error:
            problem = problem or str(error)
    return _Look(kind, problem=problem) if named else _Look(Kind.OTHER)


def _look(track: Track, position: int) -> _Look:
    picture = track.picture(position)
    if isinstance(picture, RawPicture):
        size = (picture.width, picture.height)
        channels = 1 if layout_of(picture).is_grey else 3
        return _Look(Kind.IMAGE, picture.encoding, size, channels)
    codec = codec_of(picture)
    if codec is not None:
        return _Look(Kind.VIDEO, codec, _video_size(track), 3)
    pixels = to_labels(picture)
    name = picture.format if isinstance(picture, CompressedPicture) else ""
    size = (pixels.shape[1], pixels.shape[0])
    return _Look(Kind.COMPRESSED, name, size, 1 if pixels.ndim == 2 else 3)


def _video_size(track: Track) -> tuple[int, int] | None:
    """Size of the first frame, if video can be decoded here."""
    try:
        pixels = Video(track).picture(0).pixels
    except (FrameError, LogError):
        return None
    return pixels.shape[1], pixels.shape[0]


def sources_by_topic(containers: Sequence[Container]) -> dict[str, list[Source]]:
    """Group the channels of all files by topic, in the order of the files."""
    topics: dict[str, list[Source]] = {}
    for container in containers:
        for channel_id, channel in sorted(container.channels.items()):
            topics.setdefault(channel.topic, []).append(Source(container, channel_id))
    return topics
