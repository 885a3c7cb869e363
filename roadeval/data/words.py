"""Numbers, times and lists in words for people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from os.path import commonprefix
from typing import Any, Final, TypeGuard

DASH: Final = "\N{EN DASH}"
"""Stands between two numbers, and for an undefined number."""
MINUS: Final = "\N{MINUS SIGN}"
UNSET: Final = "not given"
"""The text of a setting without a value."""
BARS: Final = "▁▂▃▄▅▆▇█"
"""Bars of a chart in a line of text, the lowest first."""


def defined(number: float | None) -> TypeGuard[float]:
    """Return whether a number has a value: it is neither None nor NaN."""
    return number is not None and not math.isnan(number)


def in_percent(fraction: float | None) -> float:
    """Return a fraction in percent; NaN if it is undefined."""
    return 100 * fraction if defined(fraction) else math.nan


def percent(fraction: float | None, digits: int = 2) -> str:
    """Return a fraction in percent, without the sign.

    >>> percent(0.2416)
    '24.16'
    """
    return f"{in_percent(fraction):.{digits}f}" if defined(fraction) else DASH


def points(difference: float | None, digits: int = 2) -> str:
    """Return a difference of two fractions in percentage points, with its sign.

    >>> points(0.079)
    '+7.90'
    """
    if not defined(difference):
        return DASH
    text = f"{in_percent(difference):+.{digits}f}"
    return text[1:] if float(text) == 0 else text.replace("-", MINUS)


def plain_points(difference: float | None, digits: int = 2) -> str:
    """Return `points` with the minus sign of ASCII, for terminals and scripts.

    >>> plain_points(-0.079)
    '-7.90'
    """
    return points(difference, digits).replace(MINUS, "-")


def interval(low: float | None, high: float | None, digits: int = 2) -> str:
    """Return an interval of the difference between two fractions in percentage points.

    >>> interval(0.01, 0.02)
    '+1.00 to +2.00'
    """
    if not defined(low) or not defined(high):
        return "none given"
    return f"{points(low, digits)} to {points(high, digits)}"


def number(value: int) -> str:
    """Return a count with a separator between thousands.

    >>> number(15222322)
    '15,222,322'
    """
    return f"{value:,}"


def counted(count: int, noun: str) -> str:
    """Return a count with its noun.

    >>> counted(1, "drive"), counted(1200, "drive")
    ('1 drive', '1,200 drives')
    """
    return f"{number(count)} {noun}{'' if count == 1 else 's'}"


def first_of(words: Sequence[str], most: int) -> str:
    """Return the first words, and how many more there are.

    >>> first_of(["a", "b", "c"], 2)
    'a, b and 1 more'
    """
    more = f" and {number(len(words) - most)} more" if len(words) > most else ""
    return f"{', '.join(words[:most])}{more}"


def setting(value: Any) -> str:
    """Return the value of a setting.

    >>> setting(None), setting([3, 4]), setting(0.50)
    ('not given', '3, 4', '0.5')
    """
    if value is None or value in ({}, [], ()):
        return UNSET
    if isinstance(value, dict):
        return ", ".join(f"{name}={item}" for name, item in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def timestamp(stamp_ns: int) -> str:
    """Return a stamp as date and time, or in seconds if it is less than a year.

    >>> timestamp(12_345_000_000)
    '12.345 s'
    """
    if stamp_ns < 365 * 24 * 3600 * 1_000_000_000:
        return f"{stamp_ns / 1e9:.3f} s"
    at = datetime.fromtimestamp(stamp_ns // 1_000_000_000, UTC)
    return f"{at:%Y-%m-%d %H:%M:%S}.{stamp_ns % 1_000_000_000 // 1_000_000:03d} UTC"


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Return several paths, each without the parts at both ends that all of them share.

    >>> short_names(["/front/image_raw", "/rear/image_raw"])
    {'/front/image_raw': 'front', '/rear/image_raw': 'rear'}
    """
    parts = [name.strip("/").split("/") for name in names]
    begin = end = 0
    if len(names) > 1:
        begin = len(commonprefix(parts))  # noqa: RUF071 - of lists it compares part by part
        end = len(commonprefix([path[:begin:-1] for path in parts]))  # noqa: RUF071
    short = ["/".join(path[begin : len(path) - end]) for path in parts]
    clear = len({*short}) == len(short) and ("" not in short or len(short) == 1)
    return dict(zip(names, short if clear else names, strict=True))


def listing(words: Sequence[str]) -> str:
    """Return words joined by commas and a last "and".

    >>> listing(["a", "b", "c"])
    'a, b and c'
    """
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]])) if words else ""
