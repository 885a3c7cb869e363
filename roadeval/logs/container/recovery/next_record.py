"""The next record that makes sense in a damaged file."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Final

from mcap.opcode import Opcode

from roadeval.logs.container.readers import FileReader
from roadeval.logs.container.records import (
    HEAD,
    INDEX_HEAD,
    LARGEST,
    LONGEST_CHUNK_HEAD,
    MAGIC,
    MESSAGE_HEAD,
    Place,
    parse,
    parse_chunk,
    parse_message_index,
    place_at,
)
from roadeval.logs.errors import BadRecord

BLOCK: Final = 1 << 20
"""Bytes to look through at a time."""
UNFINISHED: Final = 2**64 - 1
"""The length that stands before a chunk while it is being written."""
DAY: Final = 86_400 * 10**9
"""A message logged more than so many nanoseconds from all the recent ones is none."""
PLAUSIBLE: Final = re.compile(rb"(?=[\x03-\x07\x09\x0c\x0f].{4}\x00{4})", re.DOTALL)
"""The head of a record that can stand in a data section and is shorter than 4 GiB."""
_KNOWN_COMPRESSION: Final = ("", "zstd", "lz4")


class RecordFinder:
    """Decides whether a record is likely to begin at a byte, and looks for one.

    Parameters
    ----------
    channels, recent_ns
        Numbers of the known channels, and log times of the last messages, as the walk through the
        file finds them: both grow while this object is used.
    """

    def __init__(
        self, source: FileReader, channels: Collection[int], recent_ns: Collection[int]
    ) -> None:
        self._source = source
        self._channels = channels
        self._recent_ns = recent_ns

    def begins(self, offset: int) -> bool:
        """Whether a record can begin here: a head that fits, or the end of the file."""
        if offset >= self._source.size:
            return offset == self._source.size
        try:
            place = place_at(self._source, offset)
        except BadRecord:
            return False
        if offset + len(MAGIC) == self._source.size:
            return self._source.peek(offset, len(MAGIC)) == MAGIC
        return 0 < place.opcode <= Opcode.DATA_END and self._fits(place)

    def _fits(self, place: Place) -> bool:
        """Whether a record ends in the file, or can be the one that the file's end cut off."""
        length = place.end - place.body
        cut = place.opcode in (Opcode.CHUNK, Opcode.MESSAGE) and length <= LARGEST
        unfinished = place.opcode == Opcode.CHUNK and length == UNFINISHED
        return place.end <= self._source.size or cut or unfinished

    def is_message(self, place: Place) -> bool:
        """Whether this is a message of a known channel, logged within a day of a recent one."""
        if not MESSAGE_HEAD.size <= place.end - place.body <= LARGEST:
            return False
        head = self._source.peek(place.body, MESSAGE_HEAD.size)
        channel_id, _, log_time, _ = MESSAGE_HEAD.unpack(head)
        recent = self._recent_ns
        near = not recent or any(abs(log_time - time) < DAY for time in recent)
        return near and self._is_known(channel_id)

    def _is_known(self, channel_id: int) -> bool:
        return channel_id in self._channels or not self._channels

    def disguised_chunk(self, offset: int) -> Place | None:
        """Find a chunk whose opcode or length alone is damaged."""
        try:
            place = place_at(self._source, offset)
            head = self._source.peek(place.body, LONGEST_CHUNK_HEAD)
            chunk = parse_chunk(place, head)
        except BadRecord:
            return None
        end = chunk.data_offset + chunk.data_size
        fits = chunk.compression in _KNOWN_COMPRESSION and chunk.data_offset < end
        if fits and end <= self._source.size and self.begins(end):
            return Place(Opcode.CHUNK, offset, place.body, end)
        return None

    def next(self, offset: int, limit: int) -> int:
        """Find the next byte at or after ``offset`` where a record is likely to begin.

        Returns ``limit`` if there is none before.
        """
        while offset < limit:
            block = self._source.read(offset, BLOCK + HEAD.size)
            for match in PLAUSIBLE.finditer(block):
                at = offset + match.start()
                if at >= limit:
                    return limit
                if self.is_likely(at):
                    return at
            offset += BLOCK
        return limit

    def is_likely(self, offset: int) -> bool:
        """Whether a record that adds up begins here, and another after it; or the file ends."""
        if offset >= self._source.size:
            return offset == self._source.size
        try:
            place = place_at(self._source, offset)
            return self._adds_up(place) and self.begins(place.end)
        except BadRecord:
            return False

    def _adds_up(self, place: Place) -> bool:
        length = place.end - place.body
        if place.opcode == Opcode.CHUNK:
            head = self._source.peek(place.body, LONGEST_CHUNK_HEAD)
            chunk = parse_chunk(place, head)
            known = chunk.compression in _KNOWN_COMPRESSION
            return known and chunk.data_offset + chunk.data_size == place.end
        if place.end > self._source.size or length > LARGEST:
            return False
        if place.opcode == Opcode.MESSAGE:
            return self.is_message(place)
        body = self._source.peek(place.body, length)
        if place.opcode == Opcode.MESSAGE_INDEX:
            channel_id, entries = parse_message_index(bytes(body))
            return self._is_known(channel_id) and INDEX_HEAD.size + entries.nbytes == length
        parse(place.opcode, body)
        return True
