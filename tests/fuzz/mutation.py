"""Changed seeds, for where no coverage guides the changes."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Final

Change = Callable[[bytes, random.Random], bytes]

LENGTHS: Final = (1, 2, 4, 8, 16, 64, 300, 2000)
NUMBERS: Final = tuple(
    number.to_bytes(width, "little")
    for width in (1, 2, 4, 8)
    for number in (0, 1, 2 ** (8 * width - 1) - 1, 2 ** (8 * width - 1), 2 ** (8 * width) - 1)
)
"""Numbers at which lengths and sizes go wrong."""
MOST: Final = 4
"""Changes of one case."""


def changed(seeds: Sequence[bytes], rng: random.Random) -> bytes:
    """Return a seed, changed once or several times."""
    data = rng.choice(seeds)
    for _ in range(rng.randint(1, MOST)):
        if data:
            data = rng.choice(CHANGES)(data, rng)
    return data


def _flip(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def _overwrite(data: bytes, rng: random.Random) -> bytes:
    at, length = rng.randrange(len(data)), rng.choice(LENGTHS)
    filling = rng.choice((bytes(length), b"\xff" * length, rng.randbytes(length)))
    return data[:at] + filling[: len(data) - at] + data[at + length :]


def _number(data: bytes, rng: random.Random) -> bytes:
    at, number = rng.randrange(len(data)), rng.choice(NUMBERS)
    return data[:at] + number + data[at + len(number) :]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data))]


def _remove(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + data[at + rng.choice(LENGTHS) :]


def _insert(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + rng.randbytes(rng.choice(LENGTHS)) + data[at:]


def _repeat(data: bytes, rng: random.Random) -> bytes:
    """Copy a part to another place."""
    at, to, length = rng.randrange(len(data)), rng.randrange(len(data)), rng.choice(LENGTHS)
    return data[:to] + data[at : at + length] + data[to:]


CHANGES: Final[tuple[Change, ...]] = (
    *(_flip, _flip, _overwrite, _number, _cut, _remove, _insert, _repeat),
)
