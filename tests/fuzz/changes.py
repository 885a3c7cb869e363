"""Changes to bytes, as a disk, a copy or a program may make them, and the choices among them."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Final, TypeVar

from tests.fixtures.broken import over

T = TypeVar("T")

MOST: Final = 4
"""Changes of one case."""
LENGTHS: Final = (1, 2, 4, 8, 9, 16, 31, 64, 300, 512, 2000, 4096)
NUMBERS: Final = (
    *(0, 1, 8, 1 << 32, 1 << 62),
    *(2 ** (8 * width) - 1 for width in (1, 2, 4, 8)),
    *(2 ** (8 * width - 1) - less for width in (1, 2, 4, 8) for less in (0, 1)),
)
"""Numbers at which lengths and sizes go wrong."""


class Choices:
    """Reads choices from bytes; after their end every choice is the first.

    Whoever changes the bytes changes the choices.
    """

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def number(self, below: int) -> int:
        """Choose a number from 0 on, ``below`` excluded."""
        width = max((below - 1).bit_length() + 7, 8) // 8
        # A byte more than needed, so that no number is much rarer than others.
        return int.from_bytes(self.bytes(width + 1), "little") % below

    def of(self, things: Sequence[T]) -> T:
        """Choose one thing."""
        return things[self.number(len(things))]

    def bytes(self, length: int) -> bytes:
        """Take the next bytes; zeros after the end."""
        taken = self._data[self._at : self._at + length]
        self._at += length
        return taken.ljust(length, b"\0")


Change = Callable[[bytes, int, Choices], bytes]
"""Change bytes at a place."""


def changed(seeds: Sequence[bytes], rng: random.Random) -> bytes:
    """Return a seed, changed once or several times."""
    data, choices = rng.choice(seeds), Choices(rng.randbytes(1 << 14))
    for _ in range(1 + choices.number(MOST)):
        data = choices.of(CHANGES)(data, choices.number(max(len(data), 1)), choices)
    return data


def flip(data: bytes, at: int, choices: Choices) -> bytes:
    return over(data, at, bytes([data[at] ^ 1 << choices.number(8)])) if at < len(data) else data


def overwrite(data: bytes, at: int, choices: Choices) -> bytes:
    length = min(choices.of(LENGTHS), len(data) - at)
    filling = choices.of((bytes(length), b"\xff" * length, None))
    return over(data, at, choices.bytes(length) if filling is None else filling)


def number(data: bytes, at: int, choices: Choices) -> bytes:
    value, width = choices.of(NUMBERS), choices.of((1, 2, 4, 8))
    return over(data, at, value.to_bytes(8, "little")[: min(width, len(data) - at)])


def near(data: bytes, at: int, choices: Choices) -> bytes:
    """Make a number a little larger or smaller, as a length that is almost right."""
    width = min(choices.of((4, 8)), len(data) - at)
    by = choices.of((1, -1, 8, -8, 64, 256))
    value = int.from_bytes(data[at : at + width], "little") + by
    return over(data, at, (value % (1 << 8 * width)).to_bytes(width, "little"))


def _cut(data: bytes, at: int, choices: Choices) -> bytes:
    return data[:at]


def _remove(data: bytes, at: int, choices: Choices) -> bytes:
    return data[:at] + data[at + choices.of(LENGTHS) :]


def _insert(data: bytes, at: int, choices: Choices) -> bytes:
    """Put zeros, a copy of another part, or anything in between."""
    length = choices.of(LENGTHS)
    other = choices.number(max(len(data), 1))
    filling = choices.of((bytes(length), data[other : other + length], choices.bytes(length)))
    return data[:at] + filling + data[at:]


def _swap(data: bytes, at: int, choices: Choices) -> bytes:
    """Exchange two blocks, as a file system that was not whole may."""
    size = choices.of((64, 512, 4096))
    first, second = sorted((at // size * size, choices.number(max(len(data), 1)) // size * size))
    left, right = data[first : first + size], data[second : second + size]
    if first == second or len(right) < size:
        return data
    return over(over(data, first, right), second, left)


CHANGES: Final = (flip, flip, overwrite, number, _cut, _remove, _insert, _swap)
