"""Errors of reading and writing logs."""

from __future__ import annotations

from roadeval.errors import RoadevalError


class LogError(RoadevalError):
    """A problem of a log: what is wrong, in which file or topic, and what to do next."""


class UnclearLabelsError(LogError):
    """Values of labels with a meaning that only the user knows."""


class FrameError(RoadevalError):
    """One frame that cannot be decoded; a run continues without it."""


class LostMessageError(FrameError):
    """A message in an unreadable chunk, which is reported as damage of the log."""


class BadRecord(Exception):  # noqa: N818  (never leaves this room)
    """A record that is missing, or has parts that contradict each other."""


class BadMessage(RoadevalError):  # noqa: N818  (never leaves this room)
    """A message that cannot be decoded."""
