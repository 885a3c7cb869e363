"""Damage to a log: where it is, when, and which messages are lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from roadeval.logs.container.file import Container
from roadeval.logs.container.scan import Gap
from roadeval.logs.settings import NS

BEFORE_ALL: Final = int(np.iinfo(np.int64).min)
"""A log time before all others."""


@dataclass(frozen=True, slots=True)
class Damage:
    """Something wrong with a file.

    Parameters
    ----------
    path, offset
        The file, and the byte where it begins.
    reason
        What it is.
    lossy
        Whether messages are, or may be, lost or wrong by it.
    start_ns, end_ns
        Log times of the messages before and after what is lost, None where unknown.
    lost
        Topics and numbers of messages that are known to be lost.
    log_start_ns
        Log time from which the sentence counts seconds.
    """

    path: Path
    offset: int
    reason: str
    lossy: bool = True
    start_ns: int | None = None
    end_ns: int | None = None
    lost: tuple[tuple[str, int], ...] = ()
    log_start_ns: int = 0

    def __str__(self) -> str:
        text = f"{self.path.name}: {self.reason} (byte {self.offset}{self._span()})"
        if self.lost:
            listed = ", ".join(f"{count} of {topic}" for topic, count in self.lost)
            text += f"; lost: {listed}"
        elif not self.lossy:
            text += "; no message is lost"
        return text

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
    """List what is wrong with a file, as far as it is known by now, in the file's order."""
    found = [
        *_gaps(container),
        *_bad_chunks(container),
        *_wrong_indexes(container),
        *_redefined(container),
        *_missing(container),
        *_unnamed(container),
        *_wrong_sums(container),
    ]
    return tuple(sorted(found, key=lambda damage: damage.offset))


def sure_until(container: Container) -> int | None:
    """Return the log time up to which messages have the positions at which they were written.

    Where messages are lost and nothing tells how many, those after them have other positions. None
    where all are sure; damage that may lie anywhere gives a time before all others.
    """
    if _shift(container):
        return BEFORE_ALL
    ends: list[int] = []
    for gap in container.scan.gaps:
        if gap.lossy:
            before, after = _before(container, gap), _least_after(container, gap.offset)
            if before is None:
                return BEFORE_ALL
            ends.append(before if after is None else min(before, after) - 1)
    for number, chunk in enumerate(container.chunks):
        damaged = chunk.offset in container.reader.bad or chunk.offset in container.reader.kept
        if damaged and not _is_listed(container, number):
            ends.append(min([chunk.start, *_times(container, number)]) - 1)
    # Their channel's number may be what is damaged.
    unnamed = container.logs.keys() - container.channels.keys()
    ends += [container.logs[channel_id].first_ns - 1 for channel_id in unnamed]
    if not ends and any(_missing(container)):
        return BEFORE_ALL
    return min(ends, default=None)


def _least_after(container: Container, offset: int) -> int | None:
    """Return the least log time of what lies behind a byte; None if nothing does."""
    times = [chunk.start for chunk in container.chunks if chunk.offset > offset]
    for values in container.scan.loose.values():
        times += [time for time, at in zip(values[::2], values[1::2], strict=True) if at > offset]
    return min(times, default=None)


def _times(container: Container, number: int) -> list[int]:
    """Return the least log time of each channel in a chunk, which damage may have changed."""
    blocks = (block for log in container.logs.values() for block in log.blocks)
    return [int(entries[:, 0].min()) for chunk, entries in blocks if chunk == number]


def _is_listed(container: Container, number: int) -> bool:
    """Return whether all messages of a chunk have their positions, by its message indexes."""
    index = container.scan.indexes[number] or {}
    filed = {
        channel_id: sum(len(entries) for chunk, entries in log.blocks if chunk == number)
        for channel_id, log in container.logs.items()
        if log.wanted
    }
    return bool(index) and all(
        filed.get(channel_id, len(entries)) >= len(entries) for channel_id, entries in index.items()
    )


def _gaps(container: Container) -> Iterator[Damage]:
    for gap in container.scan.gaps:
        if gap.offset in container.reader.bad and not gap.lossy:
            continue
        span = (_before(container, gap), gap.after_ns)
        yield Damage(container.path, gap.offset, gap.reason, gap.lossy, *span)


def _before(container: Container, gap: Gap) -> int | None:
    """Return the log time of the last message before a gap, those saved of a cut chunk included."""
    last = container.chunks[-1] if container.chunks else None
    if last is not None and last.cut and last.offset == gap.offset:
        return container.saved_ns or gap.before_ns
    return gap.before_ns


def _bad_chunks(container: Container) -> Iterator[Damage]:
    for number, chunk in enumerate(container.chunks):
        reason = container.reader.bad.get(chunk.offset)
        if reason is not None:
            index = container.scan.indexes[number] or {}
            lost = tuple((container.topic(key), len(found)) for key, found in index.items())
            span = (chunk.start, chunk.end)
            yield Damage(container.path, chunk.offset, reason, True, *span, lost)
        if chunk.offset in container.reader.kept:
            reason = container.reader.kept[chunk.offset]
            yield Damage(container.path, chunk.offset, reason, True, chunk.start, chunk.end)


def _wrong_indexes(container: Container) -> Iterator[Damage]:
    for number in container.misled:
        reason = "the message index of a chunk is wrong"
        yield Damage(container.path, container.chunks[number].offset, reason, lossy=False)


def _redefined(container: Container) -> Iterator[Damage]:
    for offset in container.redefined:
        reason = "the summary describes topics in another way than the data, which is believed"
        yield Damage(container.path, offset, f"{reason}; either may be wrong")


def _missing(container: Container) -> Iterator[Damage]:
    """Messages that the file's own statistics count, if nothing else explains the loss."""
    if any(gap.lossy for gap in container.scan.gaps) or container.reader.bad:
        return
    for channel_id, expected in container.expected.items():
        log = container.logs.get(channel_id)
        missing = expected - (log.count if log else 0)
        if missing > 0:
            lost = ((container.topic(channel_id), missing),)
            reason = "messages that the file's own statistics count are missing"
            yield Damage(container.path, container.source.size, reason, lost=lost)


def _unnamed(container: Container) -> Iterator[Damage]:
    for channel_id, log in container.logs.items():
        if channel_id not in container.channels:
            reason = f"{log.count} messages of a channel {channel_id} that is defined nowhere"
            yield Damage(container.path, 0, reason, True, log.first_ns, log.last_ns)


def _wrong_sums(container: Container) -> Iterator[Damage]:
    scan, summary = container.scan, container.summary
    if scan.data_end is not None and summary.problem:
        shift = _shift(container)
        reason = summary.problem + (f", and {shift} before it" if shift else "")
        yield Damage(container.path, scan.data_end, reason, lossy=bool(shift))
    if container.data_is_right is False:
        unchecked = bool(scan.loose) or not all(chunk.crc for chunk in container.chunks)
        reason = "the checksum of all data is wrong"
        if unchecked:
            reason += ", and nothing tells which message is; any may be"
        elif summary.problem:
            reason += ", and no summary tells whether messages are missing"
        lossy = unchecked or bool(summary.problem)
        yield Damage(container.path, scan.data_end or 0, reason, lossy)


def _shift(container: Container) -> str:
    """Return how many bytes lie before the summary that the file's end does not know of."""
    start, found = container.summary.start, container.scan.after_data
    if start is None or found is None or start == found:
        return ""
    return f"{abs(start - found)} bytes " + ("are missing" if start > found else "too many lie")
