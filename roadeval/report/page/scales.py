"""Ranges of axes, and round numbers on them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

_STEPS: Final = (1, 2, 2.5, 5, 10)


@dataclass(frozen=True, slots=True)
class Span:
    """A closed range of numbers."""

    low: float
    high: float

    @property
    def size(self) -> float:
        """Its length."""
        return self.high - self.low

    def percent(self, value: float) -> str:
        """Return where a value stands in it, from 0 to 100."""
        return short(100 * (value - self.low) / self.size)


@dataclass(frozen=True, slots=True)
class Tick:
    """A number on an axis: where it stands, in percent from the left or the bottom."""

    place: str
    text: str


def ticks(span: Span, count: int) -> list[float]:
    """Return about ``count`` round numbers in a range.

    >>> ticks(Span(0, 9), 4)
    [0.0, 2.5, 5.0, 7.5]
    """
    rough = span.size / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(each * power for each in _STEPS if each * power >= rough * 0.999)
    first = math.ceil(span.low / step - 1e-9)
    last = math.floor(span.high / step + 1e-9)
    return [round(place * step, 10) for place in range(first, last + 1)]


def ticked(span: Span, count: int) -> list[Tick]:
    """Return about ``count`` round numbers with their places."""
    return [Tick(span.percent(each), f"{each:g}") for each in ticks(span, count)]


def short(value: float) -> str:
    """Return a number with few digits."""
    return f"{round(value, 2):g}" if abs(value) < 1e4 else f"{value:.1f}".removesuffix(".0")
