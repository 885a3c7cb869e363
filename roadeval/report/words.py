"""Numbers and times as a person reads them: percent, percentage points, seconds."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Any, Final, TypeGuard

DASH: Final = "\N{EN DASH}"
"""Between two numbers; and where a number is undefined."""
MINUS: Final = "\N{MINUS SIGN}"
_YEAR_NS: Final = 365 * 24 * 3600 * 1_000_000_000


def defined(number: float | None) -> TypeGuard[float]:
    """Tell whether a rate or an end of an interval has a value."""
    return number is not None and not math.isnan(number)


def percent(fraction: float | None, digits: int = 2) -> str:
    """Write a fraction in percent, without the sign: ``24.16``."""
    return f"{100 * fraction:.{digits}f}" if defined(fraction) else DASH


def points(fraction: float | None, digits: int = 2) -> str:
    """Write a difference of two fractions in percentage points: ``+7.90``."""
    if not defined(fraction):
        return DASH
    text = f"{100 * fraction:+.{digits}f}"
    return text[1:] if float(text) == 0 else text.replace("-", MINUS)


def interval(difference: dict[str, Any], digits: int = 2) -> str:
    """Write the interval of a difference as ``summary.json`` has it."""
    low, high = difference["low"], difference["high"]
    if not defined(low) or not defined(high):
        return "none given"
    return f"{points(low, digits)} to {points(high, digits)}"


def number(value: int) -> str:
    """Write a count with thousands apart: ``15,222,322``."""
    return f"{value:,}"


def moment(stamp_ns: int) -> str:
    """Write a stamp: the date and time where it is one, else seconds."""
    if stamp_ns < _YEAR_NS:
        return f"{stamp_ns / 1e9:.3f} s"
    at = datetime.fromtimestamp(stamp_ns // 1_000_000_000, UTC)
    return f"{at:%Y-%m-%d %H:%M:%S}.{stamp_ns % 1_000_000_000 // 1_000_000:03d} UTC"


def listing(words: list[str]) -> str:
    """Join words: ``a, b and c``."""
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]])) if words else ""
