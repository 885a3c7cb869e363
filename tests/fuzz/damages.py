"""Damage to an intact log: to the file's bytes, or inside, under checksums that are right again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from mcap.opcode import Opcode

from tests.fixtures import broken
from tests.fuzz.changes import CHANGES, MOST, Choices, flip, near, number, overwrite
from tests.fuzz.intact import Intact

CHUNK_HEAD: Final = (0, 1, 9, 17, 25, 33, 37, 41, 44, 45)
"""Where the parts of a chunk's head begin, whatever its compression is called."""
FOOTER_CRC_FROM_END: Final = len(broken.MAGIC) + 4


@dataclass(frozen=True)
class Damaged:
    """A damaged log.

    ``reached`` are the log times of the frames whose own messages were changed under checksums that
    are right: nothing can tell of such a change but the message itself.
    """

    data: bytes
    reached: frozenset[int] = frozenset()


def damaged(intact: Intact, choices: Choices) -> Damaged:
    """Damage a log as the choices say."""
    kinds = (_bytes, _bytes, _heads, _heads, _records, _summary, _inside, _messages)
    return choices.of(kinds)(intact, choices)


def _bytes(intact: Intact, choices: Choices) -> Damaged:
    """Change the file where a disk, a copy or a program might."""
    data = intact.data
    for _ in range(1 + choices.number(MOST)):
        at = _place(intact, data, choices)
        data = choices.of(CHANGES)(data, at, choices)
    return Damaged(data)


def _place(intact: Intact, data: bytes, choices: Choices) -> int:
    """Choose a byte: any, or one of those by which the file is read."""
    if choices.number(2):
        return choices.number(max(len(data), 1))
    _, begin, end = choices.of(intact.records)
    return min(begin + choices.number(min(end - begin, 80)), max(len(data) - 1, 0))


def _heads(intact: Intact, choices: Choices) -> Damaged:
    """Change the kinds, lengths, times and checksums in the heads of records."""
    data = intact.data
    for _ in range(1 + choices.number(2)):
        opcode, begin, _ = choices.of(intact.records)
        at = choices.of(CHUNK_HEAD if opcode == Opcode.CHUNK else (0, 1))
        data = choices.of((near, number, flip))(data, begin + at, choices)
    return Damaged(data)


def _records(intact: Intact, choices: Choices) -> Damaged:
    """Drop, repeat, move or exchange whole records: every checksum of a chunk stays right."""
    parts = [intact.data[begin:end] for _, begin, end in intact.records]
    tail = intact.data[intact.records[-1][2] :]
    for _ in range(1 + choices.number(2)):
        one, other = choices.number(len(parts)), choices.number(len(parts))
        kind = choices.number(4)
        if kind == 0:
            del parts[one]
        elif kind == 1:
            parts.insert(other, parts[one])
        elif kind == 2:
            parts.insert(other, parts.pop(one))
        else:
            parts[one], parts[other] = parts[other], parts[one]
    return Damaged(broken.MAGIC + b"".join(parts) + tail)


def _summary(intact: Intact, choices: Choices) -> Damaged:
    """Let the summary say something else, and its checksum agree."""
    ends = [begin for opcode, begin, _ in intact.records if opcode == Opcode.DATA_END]
    if not ends or not intact.finished:
        return _bytes(intact, choices)
    data, begin = intact.data, ends[0] + broken.length_of(intact.data, ends[0])
    end = len(data) - FOOTER_CRC_FROM_END
    for _ in range(1 + choices.number(MOST)):
        at = begin + choices.number(end - begin)
        change = choices.of((flip, number, near, overwrite))
        data = change(data[:end], at, choices) + data[end:]
    return Damaged(broken.mended(data))


def _inside(intact: Intact, choices: Choices) -> Damaged:
    """Change an uncompressed chunk, or messages outside chunks; then mend the checksums."""
    if intact.written.options.get("compression") and b"zstd" in intact.data[:2000]:
        return _messages(intact, choices)
    data = intact.data
    kinds = (Opcode.CHUNK, Opcode.MESSAGE)
    places = [(begin, end) for opcode, begin, end in intact.records if opcode in kinds]
    changed = []
    for _ in range(1 + choices.number(MOST)):
        begin, end = choices.of(places)
        head = 49 if data[begin] == Opcode.CHUNK else broken.HEAD
        at = begin + min(head + choices.number(end - begin), end - begin - 1)
        change = choices.of((flip, number, near, overwrite))
        new = data[:begin] + change(data[begin:end], at - begin, choices) + data[end:]
        changed += [i for i in range(begin, end) if new[i] != data[i]]
        data = new
    return Damaged(broken.mended(data), _reached(intact, changed))


def _reached(intact: Intact, changed: list[int]) -> frozenset[int]:
    """Return the log times of the frames in whose messages a byte was changed."""
    data, found = intact.data, set()
    for opcode, begin, _ in intact.records:
        places = broken.inside(data, begin) if opcode == Opcode.CHUNK else (begin,)
        for place in places:
            end = place + broken.length_of(data, place)
            if data[place] == Opcode.MESSAGE and any(place <= at < end for at in changed):
                log_time = int.from_bytes(data[place + broken.HEAD + 6 :][:8], "little")
                found.add(intact.frame_of(log_time))
    return frozenset(found)


def _messages(intact: Intact, choices: Choices) -> Damaged:
    """Change messages, and write the log anew around them."""
    messages = list(intact.written.messages)
    reached = set()
    for _ in range(1 + choices.number(MOST)):
        position = choices.number(len(messages))
        message = messages[position]
        reached.add(intact.frame_of(message.log_time))
        at = choices.number(max(len(message.data), 1))
        if choices.number(3) == 0:
            at = min(at, choices.number(64))
        data = choices.of(CHANGES)(message.data, at, choices)
        messages[position] = replace(message, data=data)
    changed = replace(intact, written=replace(intact.written, messages=tuple(messages)))
    return Damaged(changed.data, frozenset(reached))
