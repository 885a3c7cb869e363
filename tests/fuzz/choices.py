"""Choices that are made by bytes, so that whoever changes the bytes changes the choices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


class Choices:
    """Reads choices from bytes; after their end every choice is the first."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

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
