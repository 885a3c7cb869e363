"""A few frames of a drive, kept while it passes, for the figure of masks."""

from __future__ import annotations

from typing import Final

from roadeval.data import FrameResult, Role
from roadeval.report.figures.files import Example

SHOWN: Final = 4


class Gallery:
    """Keeps frames that lie evenly over a drive of ``total`` frames: never more than a few."""

    def __init__(self, total: int) -> None:
        self._due = [total * (2 * i + 1) / (2 * SHOWN) for i in range(SHOWN)]
        self.examples: list[Example] = []

    def look(self, position: int, result: FrameResult) -> None:
        """Keep the frame at ``position`` (from 1) if one is due and it is not a training frame."""
        if not self._due or position < self._due[0]:
            return
        if result.role in (Role.TRAINING, Role.GAP):
            return
        self._due.pop(0)
        frame = result.frame
        masks = {v.variant: v.final() for v in result.variants}
        self.examples.append(Example(frame.number, frame.image, frame.truth, masks).small())
