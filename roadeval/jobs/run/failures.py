"""Frames on which a stage failed, and where in its code."""

from __future__ import annotations

import traceback
from dataclasses import dataclass, field
from typing import Final

from roadeval.pipeline.stage import StageError

KEPT: Final = 5
"""Tracebacks that are kept: those of the first errors that say different things."""


@dataclass(frozen=True, slots=True)
class Failures:
    """The frames on which a stage has failed so far; any thread may add to them."""

    reasons: dict[int, str] = field(default_factory=dict)
    """By the frame's number: which stage failed, and why."""
    tracebacks: dict[str, str] = field(default_factory=dict)
    """By such a reason."""

    def add(self, number: int, error: StageError) -> None:
        """Note that a stage failed on a frame. The error itself would hold the frame's images."""
        self.reasons[number] = str(error)
        if len(self.tracebacks) < KEPT and str(error) not in self.tracebacks:
            self.tracebacks[str(error)] = "".join(traceback.format_exception(error))

    def sentences(self) -> tuple[str, ...]:
        """Return a sentence for each frame, in the frames' order."""
        return tuple(f"frame {number}: {self.reasons[number]}" for number in sorted(self.reasons))
