"""One MCAP log: its channels, the places of their messages, and its damage."""

from __future__ import annotations

import zlib
from array import array
from bisect import bisect_left
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import accumulate
from pathlib import Path
from typing import IO, Final

import numpy as np
import numpy.typing as npt
from mcap.records import Channel, Schema

from roadeval.logs.container.records import (
    BLOCK,
    BUFFER,
    IN_MEMORY,
    Entries,
    FileBytes,
    Message,
    message_at,
)
from roadeval.logs.container.scan import Scan, StampOf, definitions, entries_of
from roadeval.logs.errors import BadRecord
from roadeval.logs.settings import NS

OUTSIDE: Final = -1
"""The chunk number of messages outside chunks."""
BEFORE_ALL: Final = int(np.iinfo(np.int64).min) + 1
"""A log time before all others."""

ChannelTest = Callable[[Channel, Schema | None], bool]
"""Whether the messages of a channel, with its schema, will be read."""


@dataclass(slots=True)
class ChannelLog:
    """The places of the messages of one channel."""

    is_wanted: bool
    count: int = 0
    first_ns: int = np.iinfo(np.int64).max
    last_ns: int = np.iinfo(np.int64).min
    blocks: list[tuple[int, Entries]] = field(default_factory=list)
    """Chunk numbers and entries in the order of the file; empty if the channel is not wanted."""
    times_of_chunk: npt.NDArray[np.int64] | None = None
    """Log times in one chunk, ascending, if the places of other messages were not read."""

    def add(self, chunk: int, entries: Entries) -> None:
        """Add the messages of a chunk."""
        if len(entries):
            self.count += len(entries)
            self.first_ns = min(self.first_ns, int(entries[:, 0].min()))
            self.last_ns = max(self.last_ns, int(entries[:, 0].max()))
            if self.is_wanted:
                self.blocks.append((chunk, entries))


def containers_in(
    path: Path, is_wanted: ChannelTest, stamp_of: StampOf, *, opened: IO[bytes] | None = None
) -> Iterator[Container]:
    """Open the log in a file, and the logs that follow it in the same file.

    ``opened`` is the open file if it is remote. ``stamp_of`` is called only next to damage.
    """
    rest = FileBytes(opened or path.open("rb", buffering=BUFFER))
    while len(rest):
        scan = Scan(rest, stamp_of)
        if scan.next_log is not None:
            scan = Scan(rest.part(0, scan.next_log), stamp_of)
        yield Container(path, scan, is_wanted)
        rest = rest.part(len(scan.source), len(rest))


class Container:
    """One MCAP log, damaged or not; ``is_wanted`` says which messages will be read."""

    def __init__(self, path: Path, scan: Scan, is_wanted: ChannelTest) -> None:
        self.path, self.scan, self._is_wanted = path, scan, is_wanted
        self.source, self.reader, self.chunks = scan.source, scan.reader, scan.chunks
        self.schemas, self.channels = scan.schemas, scan.channels
        self.data_is_right: bool | None = None
        """Whether the checksum of all data is right; None until it is checked."""
        self.misled: set[int] = set()
        """Chunks with wrong message indexes."""
        self.redefined: dict[int, str] = {}
        """Which of two descriptions of a topic is used, in words, by the offset of the second."""
        logs = self._place_messages()
        counts = {channel_id: log.count for channel_id, log in logs.items()}
        if scan.summary.statistics and counts != {
            channel_id: count for channel_id, count in self.expected.items() if count
        }:
            logs = self._place_messages(look=True)
        if not all(map(self._is_described, logs)):  # their descriptions may be damaged
            late = [
                record for record in scan.late if isinstance(record, Schema) or record.id in logs
            ]
            for chunk in self.chunks:
                if chunk.offset in self.reader.bad:
                    late += definitions(self.reader.remains(chunk))
            for record in late:
                scan.define(record)
            logs = self._place_messages()
        self.logs = self._place_messages() if self._settle_descriptions(logs) else logs
        """The places of messages, by the number of their channel."""
        self.looked_into = frozenset(scan.seen)
        """Chunks that were searched for messages, because their message indexes are wrong."""
        scan.seen.clear()

    @property
    def expected(self) -> Mapping[int, int]:
        """The number of messages of each channel in the file's statistics; empty without these."""
        statistics = self.scan.summary.statistics
        return statistics.channel_message_counts if statistics else {}

    def topic(self, channel_id: int) -> str:
        """Return the topic of a channel, or its number if it is not defined."""
        channel = self.channels.get(channel_id)
        return channel.topic if channel else f"channel {channel_id}"

    def message(self, chunk: int, offset: int) -> Message:
        """Read the message at ``offset`` in a chunk, or in the file if the chunk is `OUTSIDE`."""
        is_outside = chunk == OUTSIDE
        records = self.source if is_outside else self.reader.read(self.chunks[chunk])
        return message_at(records, offset)

    def look(self, chunk: int, channel_id: int) -> Entries:
        """Find the messages of a channel by looking into a chunk instead of using its indexes."""
        self.misled.add(chunk)
        return self.scan.look(chunk).get(channel_id, entries_of(array("Q")))

    def is_bad(self, chunk: int) -> bool:
        """Return whether a chunk turned out to be unreadable."""
        return chunk != OUTSIDE and self.chunks[chunk].offset in self.reader.bad

    def verify(self) -> Iterator[tuple[int, bytes]]:
        """Read the log twice, so that all damage is known: by chunks, then in blocks.

        Yields the size of each chunk with no bytes, and of each block with its bytes. A `BadRecord`
        if the disk fails.
        """
        self.source.expect((chunk.data_offset, chunk.data_end) for chunk in self.chunks)
        for number, chunk in enumerate(self.chunks):
            if number not in self.looked_into:
                with suppress(BadRecord):
                    self.reader.read(chunk)
            yield chunk.data_size, b""
        for block in self._blocks():
            yield len(block), block

    def fingerprint(self) -> bytes:
        """Return sizes, places and checksums, which identify the log without its messages.

        A chunk without a checksum adds its first bytes. A `BadRecord` if the disk fails.
        """
        parts = [b"%d %d" % (len(self.source), self.scan.data_crc)]
        self.source.expect((c.data_offset, c.data_offset + 4096) for c in self.chunks if not c.crc)
        for chunk, index in zip(self.chunks, self.scan.indexes, strict=True):
            parts.append(b"%d %d %d %d" % (chunk.offset, chunk.size, chunk.data_size, chunk.crc))
            if not chunk.crc:
                begin = chunk.data_offset
                parts.append(self.source[begin : begin + min(chunk.data_size, 4096)])
            parts += [entries.tobytes() for _, entries in sorted((index or {}).items())]
        parts += [values.tobytes() for _, values in sorted(self.scan.loose.items())]
        return b"\n".join(parts)

    def _blocks(self) -> Iterator[bytes]:
        """Yield the log in blocks, and check the checksum of all data."""
        crc, end = 0, self.scan.data_end or 0
        self.source.expect([(0, len(self.source))])
        for offset in range(0, len(self.source), BLOCK):
            block = self.source[offset : offset + BLOCK]
            yield block
            if self.scan.data_crc and offset < end:
                crc = zlib.crc32(block[: end - offset], crc)
        self.data_is_right = crc == self.scan.data_crc

    @property
    def is_covered(self) -> bool:
        """Whether all messages lie in chunks with a checksum."""
        return not self.scan.loose and all(chunk.crc for chunk in self.chunks)

    def verify_data(self) -> None:
        """Check the checksum of all data, if the file has one and it is not checked yet."""
        if self.data_is_right is None and self.scan.data_crc:
            with suppress(BadRecord):
                deque(self._blocks(), 0)  # the checksum is compared after the last block

    def close(self) -> None:
        """Close the file."""
        self.source.close()

    def _place_messages(self, *, look: bool = False) -> dict[int, ChannelLog]:
        logs: dict[int, ChannelLog] = {}
        indexes = [(number, self._index(number, look=look)) for number in range(len(self.chunks))]
        outside = {channel_id: entries_of(values) for channel_id, values in self.scan.loose.items()}
        for number, index in (*indexes, (OUTSIDE, outside)):
            for channel_id, entries in index.items():
                if channel_id not in logs:
                    channel, schema = self._described(channel_id)
                    is_wanted = bool(channel and self._is_wanted(channel, schema))
                    logs[channel_id] = ChannelLog(is_wanted)
                logs[channel_id].add(number, entries)
        return logs

    def _index(self, number: int, *, look: bool) -> Mapping[int, Entries]:
        """Return the messages of a chunk by channel, from its indexes or by looking into it."""
        if number in self.scan.seen:
            return self.scan.seen[number]
        index = self.scan.indexes[number] or {}
        if look or not index or not all(map(self._is_described, index)):
            with suppress(BadRecord):
                return self.scan.look(number)
        return index

    def _described(self, channel_id: int) -> tuple[Channel | None, Schema | None]:
        channel = self.channels.get(channel_id)
        return channel, self.schemas.get(channel.schema_id) if channel else None

    def _is_described(self, channel_id: int) -> bool:
        channel, schema = self._described(channel_id)
        return channel is not None and (schema is not None or channel.schema_id == 0)

    def _settle_descriptions(self, logs: Mapping[int, ChannelLog]) -> bool:
        """Choose between two descriptions of a topic; return whether one changes or is new.

        The topic's messages decide. If they fit both descriptions, one from a chunk with a checksum
        is used: the data describes a topic in the first chunk, or in the chunk of the topic's first
        message.
        """
        before = {*self.channels}, {*self.schemas}
        first = {0} | {log.blocks[0][0] for log in logs.values() if log.blocks}
        for chunk in [self.chunks[number] for number in sorted(first - {OUTSIDE}) if self.chunks]:
            if not chunk.cut and chunk.crc and chunk.size <= IN_MEMORY:
                with suppress(BadRecord):
                    for record in definitions(self.reader.read(chunk)):
                        self.scan.define(record, chunk.offset)
        checked = {chunk.offset for chunk in self.chunks if chunk.crc}
        for offset, record in self.scan.conflicts:
            descriptions = self.scan.described(record)
            other, fits = descriptions[record.id], []
            for description in (other, record):
                descriptions[record.id] = description
                fits.append(self._fit(description, logs))
            is_this = fits[1] > fits[0] or (fits[1] == fits[0] and offset in checked)
            descriptions[record.id] = record if is_this else other
            self.redefined[offset] = (
                "a topic is described here in another way than before; "
                f"{'this' if is_this else 'that'} is believed; "
                f"{'either may be wrong' if fits[0] == fits[1] else 'messages fit it better'}"
            )
        return bool(self.redefined) or before != ({*self.channels}, {*self.schemas})

    def _fit(self, record: Schema | Channel, logs: Mapping[int, ChannelLog]) -> tuple[int, int]:
        """Return how many messages in five chunks a description decodes, and minus their delays."""
        distances = []
        for channel_id, log in logs.items():
            channel, schema = self._described(channel_id)
            if channel is None or record not in (channel, schema):
                continue
            for chunk, entries in log.blocks[:5] if self._is_wanted(channel, schema) else ():
                log_time, offset = entries[0].tolist()
                with suppress(BadRecord):
                    stamp = self.scan.stamp_of(channel, schema, self.message(chunk, offset))
                    if stamp is not None:
                        distances.append(abs(stamp - log_time))
        return len(distances), -sum(distances)


@dataclass(frozen=True)
class Damage:
    """One damaged place of a file."""

    path: Path
    offset: int
    """The byte at which it begins."""
    reason: str
    lossy: bool = True
    """Whether it may lose or spoil messages."""
    start_ns: int | None = None
    end_ns: int | None = None
    """Log times of the messages before and after the loss; None if unknown."""
    lost: tuple[tuple[str, int], ...] = ()
    """Topics, and the number of messages that each is known to lose."""
    log_start_ns: int = 0
    """Log time from which the sentence counts seconds."""
    unsure_ns: int | None = None
    """Log time from which the positions of messages may differ from the recorded ones."""

    def __str__(self) -> str:
        start, end = (
            None if time is None else f"{(time - self.log_start_ns) / NS:.3f}"
            for time in (self.start_ns, self.end_ns)
        )
        span = f", {start} to {end} s" if start and end else ""
        if not span and (start or end):
            span = f", after {start} s" if start else f", before {end} s"
        text = f"{self.path.name}: {self.reason} (byte {self.offset}{span})"
        if self.lost:
            text += "; lost: " + ", ".join(f"{count} of {topic}" for topic, count in self.lost)
        return text if self.lossy else f"{text}; no message is lost by that"


def damage_of(container: Container) -> tuple[Damage, ...]:
    """List the damage of a log that is known so far, in the order of the file."""
    path = container.path
    damages = [*_damaged_places(container), *_damaged_chunks(container), *_other_damage(container)]
    if not container.reader.bad and all(damage.unsure_ns is None for damage in damages):
        for channel_id, expected in container.expected.items():
            log = container.logs.get(channel_id)
            missing = expected - (log.count if log else 0)
            if missing > 0:
                lost = ((container.topic(channel_id), missing),)
                reason = "messages that the file's own statistics count are missing"
                end = len(container.source)
                damages.append(Damage(path, end, reason, lost=lost, unsure_ns=BEFORE_ALL))
    begin = container.source.begin
    if begin:
        reason = "another log begins here, behind the one before; its messages are read as well"
        damages.append(Damage(path, 0, reason, lossy=False))
    damages = [replace(damage, offset=begin + damage.offset) for damage in damages]
    return tuple(sorted(damages, key=lambda damage: damage.offset))


def sure_until(container: Container) -> int | None:
    """Return the log time up to which messages have the same positions as when they were recorded.

    They shift after a loss of an unknown number of messages. None if all positions are certain; a
    time before all others if the damage may lie anywhere.
    """
    doubts = (damage.unsure_ns for damage in damage_of(container))
    return min((time - 1 for time in doubts if time is not None), default=None)


def _damaged_places(container: Container) -> Iterator[Damage]:
    """Yield the invalid parts of the file, with the log times before and after each."""
    scan = container.scan
    # If a chunk is cut off, the messages before the cut were saved.
    places = [
        (chunk.offset - chunk.cut, chunk.start, (chunk.cut and scan.saved_ns) or chunk.end)
        for chunk in scan.chunks
        if not chunk.cut or scan.saved_ns is not None
    ]
    for flat in scan.loose.values() if scan.gaps else ():
        places += [(at, time, time) for time, at in zip(flat[::2], flat[1::2], strict=True)]
    places.sort()
    least = [*accumulate((start for _, start, _ in reversed(places)), min)][::-1]
    # Chunks that the summary lists are reported one by one if they are missing.
    listed = bool(scan.summary.checked and scan.summary.chunks and not scan.loose)
    for offset, _, reason, lossy in scan.gaps:
        if not lossy and offset in container.reader.bad:
            continue
        number = bisect_left(places, (offset,))
        before = places[number - 1][2] if number else None
        after = places[number][1] if number < len(places) else None
        unsure, is_lossy = None, lossy and not listed
        if is_lossy:
            unsure = BEFORE_ALL if before is None else min([before, *least[number : number + 1]])
            unsure += before is not None and after is None
        yield Damage(container.path, offset, reason, is_lossy, before, after, unsure_ns=unsure)


def _damaged_chunks(container: Container) -> Iterator[Damage]:
    """Yield chunks that are unreadable, missing, or have wrong indexes."""
    path, reader, summary = container.path, container.reader, container.scan.summary
    listed = Counter(chunk[1:4] for chunk in summary.chunks.values() if summary.checked)
    for number, chunk in enumerate(container.chunks):
        at, start, end = chunk.offset, chunk.start, chunk.end
        listed[chunk[1:4]] -= 1
        if number in container.misled:
            yield Damage(path, at, "the message index of a chunk is wrong", lossy=False)
        reason = reader.bad.get(at) or reader.flawed.get(at, "")
        if reason:
            index = container.scan.indexes[number] or {}
            lost = tuple((container.topic(key), len(entries)) for key, entries in index.items())
            lost *= at in reader.bad
            # The times in a flawed chunk may be wrong.
            unsure = BEFORE_ALL if at in reader.flawed else start
            is_sure = index and number not in container.looked_into
            unsure_ns = None if is_sure else unsure
            yield Damage(path, at, reason, True, start, end, lost, unsure_ns=unsure_ns)
    for chunk in summary.chunks.values():
        if listed[chunk[1:4]] > 0:
            listed[chunk[1:4]] -= 1
            reason, start = "a chunk that the summary lists is not there", chunk.start
            yield Damage(path, chunk.offset, reason, True, start, chunk.end, unsure_ns=start)


def _other_damage(container: Container) -> Iterator[Damage]:
    """Yield topics that are described twice or nowhere, and wrong checksums."""
    path, scan, summary = container.path, container.scan, container.scan.summary
    for offset, reason in container.redefined.items():
        yield Damage(path, offset, reason)
    for channel_id, log in container.logs.items():
        if channel_id not in container.channels:  # the number itself may be damaged
            reason = f"{log.count} messages of a channel {channel_id} that is defined nowhere"
            span = log.first_ns, log.last_ns
            yield Damage(path, 0, reason, True, *span, unsure_ns=log.first_ns)
    if scan.after_data is not None and summary.problem:
        shift = 0 if summary.start is None else summary.start - scan.after_data
        change = "are missing" if shift > 0 else "too many lie"
        reason = summary.problem + f", and {abs(shift)} bytes {change} before it" * bool(shift)
        unsure = BEFORE_ALL if shift else None
        yield Damage(path, scan.data_end or 0, reason, lossy=bool(shift), unsure_ns=unsure)
    if container.data_is_right is False:
        lossy = bool(summary.problem) or not container.is_covered
        reason = "the checksum of all data is wrong"
        reason += ", and nothing tells which messages are wrong or missing" * lossy
        yield Damage(path, scan.data_end or 0, reason, lossy)
