"""Damage to a log: where it is, when, and which messages are lost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from roadeval.logs.container.file import CHANNELS, Container
from roadeval.logs.settings import NS

BEFORE_ALL: Final = int(np.iinfo(np.int64).min) + 1
"""A log time before all others."""


@dataclass(frozen=True, slots=True)
class Damage:
    """Something wrong with a file."""

    path: Path
    offset: int
    """The byte where it begins."""
    reason: str
    lossy: bool = True
    """Whether messages are, or may be, lost or wrong by it."""
    start_ns: int | None = None
    end_ns: int | None = None
    """Log times of the messages before and after what is lost, None where unknown."""
    lost: tuple[tuple[str, int], ...] = ()
    """Topics and numbers of messages that are known to be lost."""
    log_start_ns: int = 0
    """Log time from which the sentence counts seconds."""
    harmless: str = "; no message is lost"
    """What is said where it is not lossy."""
    unsure_ns: int | None = None
    """Log time from which messages may have other positions than those they were written at."""

    def __str__(self) -> str:
        text = f"{self.path.name}: {self.reason} (byte {self.offset}{self._span()})"
        if self.lost:
            listed = ", ".join(f"{count} of {topic}" for topic, count in self.lost)
            text += f"; lost: {listed}"
        return text if self.lossy else text + self.harmless

    def _span(self) -> str:
        """Return when, in seconds after the log's start."""
        start, end = (
            None if time is None else f"{(time - self.log_start_ns) / NS:.3f}"
            for time in (self.start_ns, self.end_ns)
        )
        if start is not None and end is not None:
            return f", {start} to {end} s"
        if start is not None:
            return f", after {start} s"
        return f", before {end} s" if end is not None else ""


def damage_of(container: Container) -> tuple[Damage, ...]:
    """List what is wrong with a log, as far as it is known by now, in the file's order."""
    found = [*_gaps(container), *_chunks(container), *_absent(container), *_channels(container)]
    if not any(damage.unsure_ns is not None for damage in found) and not container.reader.bad:
        found += _missing(container)
    found += _wrong_sums(container)
    begin = container.source.begin
    if begin:
        reason = "another log begins here, behind the one before; its messages are read as well"
        found.append(Damage(container.path, 0, reason, lossy=False, harmless=""))
    found = [replace(damage, offset=begin + damage.offset) for damage in found]
    return tuple(sorted(found, key=lambda damage: damage.offset))


def sure_until(container: Container) -> int | None:
    """Return the log time up to which messages have the positions at which they were written.

    Where messages are lost and nothing tells how many, those after them have other positions. None
    where all are sure; damage that may lie anywhere gives a time before all others.
    """
    doubts = (damage.unsure_ns for damage in damage_of(container))
    return min((time - 1 for time in doubts if time is not None), default=None)


def _gaps(container: Container) -> Iterator[Damage]:
    for gap in container.scan.gaps:
        if not gap.lossy and gap.offset in container.reader.bad:
            continue
        before, after = gap.before_ns, _least_after(container, gap.offset)
        last = container.chunks[-1] if container.chunks else None
        if last is not None and last.cut and last.offset == gap.offset:
            before = container.saved_ns or before
        unsure = BEFORE_ALL if before is None else before + 1
        if before is not None and after is not None:
            unsure = min(before, after)
        span = before, gap.after_ns
        found = Damage(container.path, gap.offset, gap.reason, gap.lossy, *span)
        yield replace(found, unsure_ns=unsure if gap.lossy else None)


def _least_after(container: Container, offset: int) -> int | None:
    """Return the least log time of what lies behind a byte; None if nothing does."""
    times = [chunk.start for chunk in container.chunks if chunk.offset > offset]
    for values in container.scan.loose.values():
        times += [time for time, at in zip(values[::2], values[1::2], strict=True) if at > offset]
    return min(times, default=None)


def _chunks(container: Container) -> Iterator[Damage]:
    """Chunks that cannot be read, or whose content is not what is said of it."""
    path, reader = container.path, container.reader
    for number, chunk in enumerate(container.chunks):
        at, span = chunk.offset, (chunk.start, chunk.end)
        if number in container.misled:
            yield Damage(path, at, "the message index of a chunk is wrong", lossy=False)
        if number in container.unlisted:
            count = f"{container.unlisted[number]} records that its message indexes do not list"
            reason = f"a chunk with {count}, and which are not read"
            yield Damage(path, at, reason, True, *span, unsure_ns=chunk.start)
        reason = reader.bad.get(at) or reader.kept.get(at, "")
        if reason:
            index = container.scan.indexes[number] or {}
            lost = tuple((container.topic(key), len(found)) for key, found in index.items())
            unsure = _unsure_of(container, number)
            yield Damage(path, at, reason, True, *span, lost * (at in reader.bad), unsure_ns=unsure)


def _unsure_of(container: Container, number: int) -> int | None:
    """Return the log time from which positions are unsure because of a damaged chunk.

    None if its message indexes give all its messages their positions.
    """
    index = container.scan.indexes[number] or {}
    filed: dict[int, int] = {}
    first_ns = container.chunks[number].start
    for channel_id, log in container.logs.items():
        for chunk, entries in log.blocks if log.wanted else ():
            if chunk == number:
                filed[channel_id] = filed.get(channel_id, 0) + len(entries)
                first_ns = min(first_ns, int(entries[:, 0].min()))
    wanted = {key: len(found) for key, found in index.items() if key in filed}
    return None if index and all(filed[key] >= wanted[key] for key in wanted) else first_ns


def _absent(container: Container) -> Iterator[Damage]:
    """Chunks that the summary lists and that were not found."""
    found = Counter((chunk.start, chunk.end, chunk.size) for chunk in container.chunks)
    listed = container.summary.chunks.values() if container.summary.checked else ()
    for chunk in listed:
        start, end, size = chunk.start, chunk.end, chunk.size
        found[start, end, size] -= 1
        if found[start, end, size] < 0:
            reason = "a chunk that the summary lists is not there"
            yield Damage(container.path, chunk.offset, reason, True, start, end, unsure_ns=start)


def _missing(container: Container) -> Iterator[Damage]:
    """Messages that the file's own statistics count, where nothing else explains the loss."""
    for channel_id, expected in container.expected.items():
        log = container.logs.get(channel_id)
        missing = expected - (log.count if log else 0)
        if missing > 0 and channel_id not in container.channels_left_out:
            lost = ((container.topic(channel_id), missing),)
            reason = "messages that the file's own statistics count are missing"
            end = len(container.source)
            yield Damage(container.path, end, reason, lost=lost, unsure_ns=BEFORE_ALL)


def _channels(container: Container) -> Iterator[Damage]:
    path, left_out = container.path, len(container.channels_left_out)
    for offset, reason in container.redefined.items():
        yield Damage(path, offset, reason)
    if left_out:
        count = left_out + len(container.channels)
        yield Damage(path, 0, f"{count} channels, of which {CHANNELS} are read")
    for channel_id, log in container.logs.items():
        if channel_id not in container.channels:  # its number may be what is damaged
            reason = f"{log.count} messages of a channel {channel_id} that is defined nowhere"
            span = log.first_ns, log.last_ns
            yield Damage(path, 0, reason, True, *span, unsure_ns=log.first_ns)


def _wrong_sums(container: Container) -> Iterator[Damage]:
    path, scan, summary = container.path, container.scan, container.summary
    if scan.data_end is not None and summary.problem:
        shift = _shift(container)
        reason = summary.problem + (f", and {shift} before it" if shift else "")
        unsure = BEFORE_ALL if shift and not container.is_complete else None
        yield Damage(path, scan.data_end, reason, lossy=bool(shift), unsure_ns=unsure)
    if container.data_is_right is False:
        unchecked = bool(scan.loose) or not all(chunk.crc for chunk in container.chunks)
        reason = "the checksum of all data is wrong"
        if unchecked:
            reason += ", and nothing tells which message is; any may be"
        elif summary.problem:
            reason += ", and no summary tells whether messages are missing"
        yield Damage(path, scan.data_end or 0, reason, unchecked or bool(summary.problem))


def _shift(container: Container) -> str:
    """Return how many bytes lie before the summary that the file's end does not know of."""
    start, found = container.summary.start, container.scan.after_data
    if not container.summary.problem or start is None or found is None or start == found:
        return ""
    return f"{abs(start - found)} bytes " + ("are missing" if start > found else "too many lie")
