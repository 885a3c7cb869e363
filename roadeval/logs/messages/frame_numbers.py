"""Frame numbers of H.264: they tell of lost pictures, which FFmpeg fills in without a word.

References
----------
Recommendation ITU-T H.264 (2024), 7.3.2.1.1 and 7.3.3 (the fields), 7.4.3 (``frame_num``).
"""

from __future__ import annotations

import re
from typing import Final

_START: Final = re.compile(rb"\x00\x00\x01")
_SLICE, _KEY_SLICE, _PARAMETERS = 1, 5, 7
"""Kinds of units: a slice, one of a keyframe, and the sequence's parameters."""
_REFERENCE: Final = 0b11 << 5
"""Bits of a unit that others build upon; one of them is set."""
_WITH_CHROMA: Final = (100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135)
"""Profiles whose parameters say how colours are stored."""
_HEAD: Final = 64
"""Bytes of a unit that hold what is read of it."""


class FrameNumbers:
    """Follows the frame numbers of a stream, unit by unit."""

    def __init__(self) -> None:
        self._width = 0
        """Bits of a frame number; 0 where it is not known, or gaps are allowed."""
        self._last: int | None = None

    def is_gap(self, data: bytes) -> bool:
        """Take in a packet; return whether a picture that it builds upon is lost before it."""
        gap = False
        for match in _START.finditer(data):
            unit = data[match.end() : match.end() + _HEAD].replace(b"\0\0\3", b"\0\0")
            kind, bits = unit[0] & 31 if unit else 0, _Bits(unit[1:])
            if kind == _PARAMETERS:
                self._width = _bits_of_number(bits)
            elif kind in (_SLICE, _KEY_SLICE) and self._width and bits.count() == 0:
                # The first slice of a picture.
                bits.count(), bits.count()
                number, last = bits.take(self._width), self._last
                follows = last is None or number in (last, (last + 1) % (1 << self._width))
                gap |= kind == _SLICE and not follows
                if unit[0] & _REFERENCE:
                    self._last = number
        return gap

    @property
    def are_counted(self) -> bool:
        """Whether pictures have numbers, as far as the stream was followed."""
        return self._width > 0


class _Bits:
    """Reads a unit bit by bit."""

    def __init__(self, data: bytes) -> None:
        self._text = "".join(f"{byte:08b}" for byte in data)
        self._at = 0

    def take(self, count: int) -> int:
        """Return the number of so many bits."""
        self._at += count
        return int(self._text[self._at - count : self._at] or "0", 2)

    def count(self) -> int:
        """Return a number in Exponential-Golomb code."""
        zeros = max(self._text.find("1", self._at) - self._at, 0)
        self._at += zeros
        return self.take(zeros + 1) - 1


def _bits_of_number(bits: _Bits) -> int:
    """Return how many bits a frame number has; 0 where that is not known or gaps are allowed."""
    profile, _, _ = bits.take(8), bits.take(16), bits.count()
    if profile in _WITH_CHROMA:
        planes = bits.count() == 3 and bits.take(1)
        bits.count(), bits.count(), bits.take(1)
        if planes or bits.take(1):  # its own matrices are not read
            return 0
    width, order = bits.count() + 4, bits.count()
    if order == 1:
        return 0
    if order == 0:
        bits.count()
    bits.count()
    return 0 if bits.take(1) else width
