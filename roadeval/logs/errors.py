"""Errors of reading and writing logs."""

from __future__ import annotations

from roadeval.errors import RoadevalError


class LogError(RoadevalError):
    """A log that cannot be used as asked: what, which file or topic, and what to do next."""


class UnclearLabelsError(LogError):
    """Values of labels whose meaning only the user knows."""


class FrameError(RoadevalError):
    """One frame that cannot be decoded; a run continues without it."""


class LostMessageError(FrameError):
    """A message in a chunk that cannot be read, which is a damage of the log by itself."""


class BadRecord(Exception):  # noqa: N818  (never leaves this room)
    """A record whose parts contradict each other, or that is not there."""


class BadMessage(RoadevalError):  # noqa: N818  (never leaves this room)
    """A message that cannot be decoded."""
