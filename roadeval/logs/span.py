"""The part of a log that is read."""

from __future__ import annotations

from dataclasses import dataclass

from roadeval.logs.settings import FrameSettings
from roadeval.logs.times import Instant, parse_time


@dataclass(frozen=True, slots=True)
class Span:
    """A part of a log, by log time.

    Parameters
    ----------
    start, end
        At or after, and before: None for the log's own.
    every
        Take the first frame of the range and every that many after it.
    max_frames
        Stop after that many frames were read.
    """

    start: Instant | None = None
    end: Instant | None = None
    every: int = 1
    max_frames: int | None = None

    @classmethod
    def of(cls, settings: FrameSettings) -> Span:
        """Return the part of a log that the settings name."""
        start, end = (
            None if text is None else parse_time(text) for text in (settings.start, settings.end)
        )
        return cls(start, end, settings.every, settings.max_frames)
