"""The messages of one topic, in the order of their log times; and the description of a topic."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap.records import Channel, Schema

from roadeval.images.decoding import orientation_of
from roadeval.images.formats import Limits, Size
from roadeval.logs.container.file import OUTSIDE, ChannelLog, Container, sure_until
from roadeval.logs.container.records import Message
from roadeval.logs.errors import BadMessage, BadRecord, FrameError, LogError, LostMessageError
from roadeval.logs.messages import pictures
from roadeval.logs.messages.encoding import PICTURES, TopicKind
from roadeval.logs.messages.pixels import lossy_format, raw_format, to_labels
from roadeval.logs.settings import NS

CACHE: Final = 16 << 20
"""Bytes of a topic's small messages in memory. A label's stamp is read long before its picture: by
then its chunk, which holds mostly other topics, is no longer in memory."""
ENOUGH: Final = 5
"""The rate of a topic is computed from more intervals between messages than this."""
FIRST_KEYFRAME: Final = 300
"""Packets among which a video's first keyframe is searched; a log may begin between keyframes."""
SMALL: Final = 50_000_000
"""Bytes of a log that may be read completely, which takes a moment."""


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a log."""

    name: str
    schema: str
    encoding: str
    """The messages' encoding: ``cdr``, ``protobuf``, ..."""
    kind: TopicKind
    """The content of its messages, by the schema's name."""
    count: int
    """Messages in the log, readable or not."""
    first_ns: int | None = None
    last_ns: int | None = None
    """Log times of the first and the last message, None if there is none."""
    rate_hz: float | None = None
    """One over the median time between messages; None below two messages. If the times of some were
    not read, it is the median of one chunk, or the mean."""
    gaps: tuple[tuple[int, int], ...] = ()
    """Log times around each step of more than 2.5 median periods, for images only."""
    format: str = ""
    """Pixel encoding or file format of the first readable image, as the fields below."""
    size: Size | None = None
    channels: int | None = None
    """1 for an image of single values, 3 for one of colours."""
    lossy: str = ""
    """Its format if that changes values, as JPEG; else empty."""
    frame_id: str = ""
    """The camera's name in its header, or empty."""
    turned: int = 1
    """Its orientation, as EXIF counts it; 1 if it is not turned."""
    problem: str = ""
    """Why no message could be decoded, or empty."""

    @property
    def is_image(self) -> bool:
        """Whether its messages carry images, as pixels, files or video."""
        return self.kind in PICTURES

    @property
    def is_cloud(self) -> bool:
        """Whether its messages carry points in space."""
        return self.schema in ("sensor_msgs/msg/PointCloud2", "foxglove.PointCloud")


def describe_topic(reader: TopicReader) -> TopicInfo:
    """Describe a topic by the places of its messages, and by the first readable one."""
    # A topic may have channels of several schemas: a channel with messages that are read counts.
    _, channel, schema, _ = max(reader.channels, key=lambda source: _use_of(source.log))
    logs = [source.log for source in reader.channels if source.log.count]
    if pictures.kind_of(channel, schema) in (TopicKind.VIDEO, TopicKind.COMPRESSED):
        reader.join_parameters()
    count = sum(log.count for log in logs) - reader.joined
    first = min((log.first_ns for log in logs), default=None)
    last = max((log.last_ns for log in logs), default=None)
    times = reader.log_times
    if len(times) < count:
        times, some = times[:0], logs[0].times_of_chunk
        period = median_period(some) if some is not None and len(some) > ENOUGH else 0
    else:
        period = median_period(times)
    rate = NS / period if period > 0 else None
    # If a topic is not read, only the number of its messages and their time range are known.
    if rate is None and count > 1 and first is not None and last is not None and last > first:
        rate = (count - 1) * NS / (last - first)
    before = np.flatnonzero(np.diff(times) > 2.5 * period) if period > 0 else ()
    topic = TopicInfo(
        name=reader.name,
        schema=schema.name if schema else "",
        encoding=channel.message_encoding,
        kind=pictures.kind_of(channel, schema),
        count=count,
        first_ns=first,
        last_ns=last,
        rate_hz=rate,
        gaps=tuple((int(times[i]), int(times[i + 1])) for i in before),
    )
    if not topic.is_image:
        return topic
    # Three messages are tried. A topic without a schema is one of images only if one is readable.
    problem, tries = "", 0
    for position in range(len(reader)):
        try:
            return replace(topic, **_describe_picture(reader, position))
        except (FrameError, BadMessage) as error:
            problem = problem or error.sentence
        tries += not reader.is_lost(position)
        if tries == 3:
            break
    return replace(topic, problem=problem) if topic.schema else replace(topic, kind=TopicKind.OTHER)


def _use_of(log: ChannelLog) -> tuple[bool, bool]:
    return log.is_wanted and log.count > 0, log.count > 0


def median_period(log_times: npt.NDArray[np.int64]) -> int:
    """Return the median time between messages in nanoseconds; 0 below two messages."""
    return int(np.median(np.diff(log_times))) if len(log_times) > 1 else 0


def _describe_picture(reader: TopicReader, position: int) -> dict[str, Any]:
    """Return the fields of a `TopicInfo` that one of its messages shows."""
    picture = reader.picture(position)
    kind, size, channels, turned = TopicKind.VIDEO, None, 3, 1
    if isinstance(picture, pictures.RawPicture):
        kind, name, size = TopicKind.IMAGE, picture.encoding, (picture.width, picture.height)
        channels = 1 if raw_format(picture, reader.limits).is_grey else 3
    elif name := pictures.codec_of(picture) or "":
        video = pictures.Video(reader, reader.limits)
        for at in range(min(len(reader), FIRST_KEYFRAME)):
            with suppress(FrameError, LogError):
                first = video.picture(at)
                size, turned = first.pixels.shape[1::-1], first.turned
                break
    else:
        pixels, turned = to_labels(picture, reader.limits), orientation_of(picture.data)
        kind, name, size = TopicKind.COMPRESSED, picture.format, pixels.shape[1::-1]
        channels = 1 if pixels.ndim == 2 else 3
    return {
        "kind": kind,
        "format": name,
        "size": size,
        "channels": channels,
        "lossy": lossy_format(picture),
        "frame_id": picture.frame_id,
        "turned": turned,
    }


UNREADABLE: Final = -(2**63) + 1
"""Stands for a stamp that cannot be read."""
UNREAD: Final = UNREADABLE - 1
"""Stands for a stamp that is not read yet."""


class FileChannel(NamedTuple):
    """A channel of one file of the log."""

    container: Container
    channel: Channel
    schema: Schema | None
    log: ChannelLog
    """The places of its messages."""


class TopicReader:
    """The messages of one topic, from all files and channels that carry it.

    Only one thread may read at a time. ``limits`` apply to its images. ``log_times`` are ``(n,)``
    int64 nanoseconds, ascending; equal ones are in the order of the file.
    """

    def __init__(
        self,
        name: str,
        channels: Sequence[FileChannel],
        limits: Limits,
        files: Sequence[Container],
        *,
        lacks_files: bool,
    ) -> None:
        self.name = name
        self.channels = channels
        self.limits = limits
        self._files = files  # all of the log: a damaged one may have lost the topic itself
        self._lacks_files = lacks_files
        rows = [
            np.hstack([entries, np.full((len(entries), 2), (number, chunk), np.int64)])
            for number, source in enumerate(channels)
            for chunk, entries in source.log.blocks
        ]
        table = np.concatenate([np.empty((0, 4), np.int64), *rows])
        table = table[np.argsort(table[:, 0], kind="stable")]
        self.log_times: npt.NDArray[np.int64] = np.ascontiguousarray(table[:, 0])
        self._places = table[:, 1:]
        """``(n, 3)``: each message's offset, its channel's number here, and its chunk's number."""
        # An array of Python, because each image takes some thirty stamps, one by one.
        self._stamps = array("q", [UNREAD]) * len(table)
        self.delays: tuple[int, int] | None = None
        """The least and the greatest time from stamp to log time, of the stamps read so far."""
        self._cache: dict[int, Message] = {}
        self._cached_bytes = 0
        self._before: dict[int, list[tuple[FileChannel, Message]]] = {}
        """Packets of a video without a picture, by the position of the packet behind them."""

    def __len__(self) -> int:
        return len(self.log_times)

    def message(self, position: int) -> Message:
        """Read a message; a `FrameError` if it cannot be read."""
        if position in self._cache:
            return self._cache[position]
        message = self._read(position)
        if message is None and self._places[position, 2] != OUTSIDE:
            self._correct(position)
            message = self._read(position)
        if message is None:
            raise self._error(position, "no message where the index says")
        if len(message.data) <= CACHE >> 6:
            # A copy, because a view of the data would hold its chunk in memory.
            message = message._replace(data=memoryview(bytes(message.data)))
            self._cache[position] = message
            self._cached_bytes += len(message.data)
            while self._cached_bytes > CACHE:
                self._cached_bytes -= len(self._cache.pop(next(iter(self._cache))).data)
        return message

    def _read(self, position: int) -> Message | None:
        """Read a message; None if it is not the one that the index lists."""
        offset, number, chunk = self._places[position].tolist()
        source = self.channels[number]
        try:
            message: Message = source.container.message(chunk, offset)
        except BadRecord as error:
            if source.container.is_bad(chunk):
                where = f"{self.name} message {position}"
                raise LostMessageError(str(error), where=where) from error
            return None
        # Times beyond int64 are negative in the table.
        same_time = message.log_time == int(self.log_times[position]) % 2**64
        return message if same_time and message.channel_id == source.channel.id else None

    def _correct(self, position: int) -> None:
        """Correct the places of a chunk's messages by looking into the chunk."""
        _, number, chunk = self._places[position].tolist()
        source = self.channels[number]
        here = np.flatnonzero((self._places[:, 1:] == (number, chunk)).all(axis=1))
        listed = {(int(self.log_times[i]), int(self._places[i, 0])): i for i in here}
        entries = [tuple(e) for e in source.container.look(chunk, source.channel.id).tolist()]
        missed = [entry for entry in entries if entry not in listed]
        for wrong, right in zip(sorted(listed.keys() - {*entries}), missed, strict=False):
            self.log_times[listed[wrong]], self._places[listed[wrong], 0] = right

    def picture(self, position: int) -> pictures.LoggedPicture:
        """Read the picture of a message; a `FrameError` if it cannot be read or decoded.

        A packet of a video begins with those before it that have no picture.
        """
        message = self.message(position)
        try:
            picture = self._decoder(position).picture(message.data)
            if not isinstance(picture, pictures.CompressedPicture):
                return picture
            number = message.sequence if picture.number is None else picture.number
            before = [
                pictures.decoder_for(carrier.channel, carrier.schema).picture(packet.data).data
                for carrier, packet in self._before.get(position, ())
            ]
            data = b"".join(map(bytes, (*before, picture.data))) if before else picture.data
            return replace(picture, number=number, data=data)
        except BadMessage as error:
            raise self._error(position, error.sentence) from error

    def join_parameters(self) -> None:
        """Take the packets of a video that have no picture as parts of the packet behind them.

        All packets are read if one without a picture comes before the first keyframe.
        """
        for position in range(min(len(self), FIRST_KEYFRAME)):
            with suppress(FrameError):
                packet = self.picture(position)
                if pictures.has_no_picture(packet):
                    break
                if pictures.codec_of(packet) is None or pictures.is_keyframe(packet):
                    return
        else:
            return
        before, with_picture = dict[int, list[tuple[FileChannel, Message]]](), list[int]()
        for position in range(len(self)):
            with suppress(FrameError):
                if pictures.has_no_picture(self.picture(position)):
                    joined = self.carrier(position), self.message(position)
                    before.setdefault(len(with_picture), []).append(joined)
                    continue
            with_picture.append(position)
        self.log_times, self._places = self.log_times[with_picture], self._places[with_picture]
        self._stamps = array("q", [UNREAD]) * len(with_picture)
        self._before, self._cache, self._cached_bytes = before, {}, 0

    def messages(self, position: int) -> Iterator[tuple[FileChannel, Message]]:
        """Read a message, and before it the packets that were joined to it."""
        yield from self._before.get(position, ())
        yield self.carrier(position), self.message(position)

    def fields(self, position: int) -> Any:
        """Read a message of any kind; a `FrameError` or `BadMessage` if that fails."""
        return self._decoder(position).fields(self.message(position).data)

    def stamp(self, position: int) -> int:
        """Return the header stamp of a message in nanoseconds, or `UNREADABLE`."""
        stamp = self._stamps[position]
        if stamp == UNREAD:
            try:
                data = self.message(position).data
                stamp = self._decoder(position).stamp(data)
            except (FrameError, BadMessage):
                stamp = UNREADABLE
            if not UNREADABLE <= stamp < 2**63:  # tables cannot hold it
                stamp = UNREADABLE
            if stamp != UNREADABLE:
                delay = int(self.log_times[position]) - stamp
                least, greatest = self.delays or (delay, delay)
                self.delays = min(least, delay), max(greatest, delay)
            self._stamps[position] = stamp
        return stamp

    def knows(self, position: int) -> bool:
        """Return whether the header stamp of a message is read already."""
        return self._stamps[position] != UNREAD

    def frame_id(self, position: int) -> str:
        """Return the camera's name in a message's header; empty if it has none or is damaged."""
        try:
            return self.picture(position).frame_id
        except FrameError:
            return ""

    def place(self, _position: int) -> str:
        """Return the place of a message, to show it to people."""
        return self.name

    def is_lost(self, position: int) -> bool:
        """Return whether a message lies in a chunk that turned out to be unreadable."""
        _, number, chunk = self._places[position].tolist()
        return self.channels[number].container.is_bad(chunk)

    def parts(self, log_times: npt.NDArray[np.int64]) -> Iterator[tuple[int, int]]:
        """Yield the bytes of the file with the chunks that hold messages of some times."""
        positions = np.searchsorted(self.log_times[:-1], log_times)
        for _, number, chunk in self._places[positions].tolist():
            container = self.channels[number].container
            if chunk == OUTSIDE:
                yield 0, 0
            else:
                begin, data = container.source.begin, container.chunks[chunk]
                yield begin + data.data_offset, begin + data.data_end

    def expect(self, parts: Iterable[tuple[int, int]]) -> None:
        """Announce the bytes of the file that are read next, as `FileBytes.expect` does."""
        self._files[0].source.expect(parts)

    def chunks_of(self, positions: Sequence[int]) -> int:
        """Count the chunks in which some messages lie; a message outside chunks counts as one."""
        places = self._places[np.asarray(positions, np.intp)]
        inside = places[places[:, 2] != OUTSIDE, 1:]
        return len(np.unique(inside, axis=0)) + len(places) - len(inside)

    @property
    def joined(self) -> int:
        """The number of packets without a picture, which are parts of others."""
        return sum(map(len, self._before.values()))

    def expected(self) -> int:
        """Return the number of messages by the files' own statistics."""
        total = sum(s.container.expected.get(s.channel.id, 0) for s in self.channels)
        return total - self.joined

    @property
    def sure(self) -> int:
        """The number of messages, from the first one on, that certainly have the recorded position.

        An unknown number of messages may be lost before the others.
        """
        if self._lacks_files:
            return 0
        ends = [end for end in map(sure_until, self._files) if end is not None]
        return int(np.searchsorted(self.log_times, min(ends), side="right")) if ends else len(self)

    @property
    def is_small(self) -> bool:
        """Whether its files can be read completely in a moment."""
        return sum(len(file.source) for file in self._files) <= SMALL

    def readable(self) -> int:
        """Count the messages outside damaged chunks."""
        chunks, counts = np.unique(self._places[:, 1:], axis=0, return_counts=True)
        is_bad = [self.channels[n].container.is_bad(chunk) for n, chunk in chunks.tolist()]
        return int(counts[~np.array(is_bad, bool)].sum())

    def carrier(self, position: int) -> FileChannel:
        """Return the channel that carries a message."""
        return self.channels[self._places[position, 1]]

    def span(self, kind: TopicKind, begin: int, end: int, stamp: int) -> Iterator[int]:
        """Yield the positions of the messages that belong to a span of log times.

        Images up to 10 s later may be labels of it, if their stamps are at most ``stamp``.
        """
        low, high = np.searchsorted(self.log_times, (begin, end + 1)).tolist()
        if kind is TopicKind.TRANSFORMS:
            yield from range(min(low, 100))  # as many as a replay reads
        elif kind in (TopicKind.CALIBRATION, TopicKind.CLASSES):
            yield from range(max(low - 1, 0), low)
        elif kind is TopicKind.VIDEO and low < high:
            video = pictures.Video(self, self.limits)
            low = video.keyframe(low)
            with suppress(FrameError):
                yield from {video.parameters(low)[0]} - {low}
        latest = np.searchsorted(self.log_times, end + 10 * NS) if kind in PICTURES else high
        while high < latest and self.stamp(0) < self.stamp(high) <= stamp:
            high += 1
        yield from range(low, high)

    def _decoder(self, position: int) -> pictures.Decoder:
        source = self.carrier(position)
        return pictures.decoder_for(source.channel, source.schema)

    def _error(self, position: int, reason: str) -> FrameError:
        return FrameError(reason, where=f"{self.name} message {position}")


def topic_readers(
    containers: Sequence[Container], limits: Limits, *, lacks_files: bool
) -> dict[str, TopicReader]:
    """Return a reader for each topic; ``lacks_files`` says whether files of the log are missing."""
    channels: dict[str, list[FileChannel]] = {}
    for container in containers:
        for channel_id, channel in sorted(container.channels.items()):
            schema = container.schemas.get(channel.schema_id)
            log = container.logs.get(channel_id, ChannelLog(is_wanted=False))
            carriers = channels.setdefault(channel.topic, [])
            carriers.append(FileChannel(container, channel, schema, log))
    for topic, carriers in channels.items():
        # Messages of another kind on a topic of images are not images that are lost.
        images = [c for c in carriers if pictures.kind_of(c.channel, c.schema) in PICTURES]
        if any(source.schema and source.log.count for source in images):
            channels[topic] = images
    return {
        topic: TopicReader(topic, carriers, limits, containers, lacks_files=lacks_files)
        for topic, carriers in channels.items()
    }
