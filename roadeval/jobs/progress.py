"""The progress of a job."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """How far a job is: ``done`` of ``total`` frames of ``stage``.

    ``stage`` is ``looking``, ``training``, ``replaying``, ``writing``, ``reading``, ``rendering``,
    ``comparing`` or ``verifying``; ``total`` is None if it is not known.
    """

    done: int
    total: int | None
    stage: str
    note: str = ""
    """A sentence that the user should read now, not at the end."""
    unit: str = "frames"
    detail: str = ""
    """A few further words, such as the number of failed drives."""


OnProgress = Callable[[Progress], None]


def ignore(_progress: Progress) -> None:
    """Show nothing."""
