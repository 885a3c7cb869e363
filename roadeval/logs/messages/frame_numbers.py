"""Frame numbers of H.264: they show lost pictures, which FFmpeg fills in without a warning.

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
_WITH_CHROMA: Final = (100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135)
"""Profiles with parameters on the storage of colours."""


class FrameNumbers:
    """Follows the frame numbers of a stream, unit by unit."""

    def __init__(self) -> None:
        self._width = 0
        """Bits of a frame number; 0 if unknown, or if gaps are allowed."""
        self._last: int | None = None

    def is_gap(self, data: bytes) -> bool:
        """Follow a packet; return whether a picture that it depends on is lost before it."""
        gap = False
        for match in _START.finditer(data):
            # The first bytes of a unit are enough.
            unit = data[match.end() : match.end() + 64].replace(b"\0\0\3", b"\0\0")
            kind, bits = unit[0] & 31 if unit else 0, _Bits(unit[1:])
            if kind == _PARAMETERS:
                self._width = bits.number_width()
            elif kind in (_SLICE, _KEY_SLICE) and self._width and bits.count() == 0:
                # This is the first slice of a picture.
                bits.count(), bits.count()
                number, last = bits.take(self._width), self._last
                follows = last is None or number in (last, (last + 1) % (1 << self._width))
                gap |= kind == _SLICE and not follows
                if unit[0] & 0b1100000:  # other pictures depend on it
                    self._last = number
        return gap

    @property
    def are_counted(self) -> bool:
        """Whether pictures have numbers in the stream so far."""
        return self._width > 0


class _Bits:
    """Reads a unit bit by bit."""

    def __init__(self, data: bytes) -> None:
        self._text = "".join(f"{byte:08b}" for byte in data)
        self._at = 0

    def take(self, count: int) -> int:
        """Return the number in the next ``count`` bits."""
        self._at += count
        return int(self._text[self._at - count : self._at] or "0", 2)

    def count(self) -> int:
        """Return a number in Exponential-Golomb code."""
        zeros = max(self._text.find("1", self._at) - self._at, 0)
        self._at += zeros
        return self.take(zeros + 1) - 1

    def number_width(self) -> int:
        """Read parameters; return the bits of a frame number, 0 if unknown or gaps are allowed."""
        profile, _, _ = self.take(8), self.take(16), self.count()
        if profile in _WITH_CHROMA:
            planes = self.count() == 3 and self.take(1)
            self.count(), self.count(), self.take(1)
            if planes or self.take(1):  # scaling matrices are not read
                return 0
        width, order = self.count() + 4, self.count()
        if order == 1:
            return 0
        if order == 0:
            self.count()
        self.count()
        return 0 if self.take(1) else width
