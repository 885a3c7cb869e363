"""Moments of a log's clock, and how they are written."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from roadeval.logs.errors import LogError

NS: Final = 1_000_000_000
_EPOCH: Final = datetime.fromisoformat("1970-01-01T00:00:00+00:00")
_RFC_3339: Final = re.compile(
    r"(\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d:\d\d)(?:\.(\d{1,9}))?([Zz]|[+-]\d\d:\d\d)"
)


@dataclass(frozen=True, slots=True)
class Instant:
    """A moment: nanoseconds of the log's clock, or after the log's first message."""

    ns: int
    relative: bool = False

    def resolve(self, start_ns: int) -> int:
        """Nanoseconds of the log's clock, for a log that starts at ``start_ns``."""
        return start_ns + self.ns if self.relative else self.ns


def parse_time(text: str) -> Instant:
    """Parse a moment as people write it.

    ``2.5`` and ``90`` are seconds after the log's first message; a whole number from 1000000000
    on is nanoseconds of the log's clock (below it lies the clock's first second); ``12s`` and
    ``12ns`` say which they are; and there is ``2013-05-01T12:00:00.5Z`` (RFC 3339).

    Raises
    ------
    LogError
        If it is none of these.
    """
    text = text.strip()
    if match := _RFC_3339.fullmatch(text):
        return Instant(_rfc_3339_ns(match, text))
    if match := re.fullmatch(r"(\d+)(ns)?", text):
        if match[2] or int(match[1]) >= NS:
            return Instant(int(match[1]))
        return Instant(int(match[1]) * NS, relative=True)
    if match := re.fullmatch(r"(\d*)\.?(\d*)s?", text):
        whole, fraction = match.groups()
        if whole or fraction:
            nanoseconds = int(fraction[:9].ljust(9, "0"))
            return Instant(int(whole or 0) * NS + nanoseconds, relative=True)
    raise LogError(
        f"{text!r} is no time: give seconds from the start (2.5), nanoseconds, or "
        "2013-05-01T12:00:00Z"
    )


def _rfc_3339_ns(match: re.Match[str], text: str) -> int:
    moment, fraction, zone = match.groups()
    try:
        at = datetime.fromisoformat(moment.upper() + zone.upper().replace("Z", "+00:00"))
    except ValueError as error:
        raise LogError(f"{text!r} is no time: {error}") from error
    since = at - _EPOCH
    seconds = since.days * 86400 + since.seconds
    return seconds * NS + int((fraction or "").ljust(9, "0"))
