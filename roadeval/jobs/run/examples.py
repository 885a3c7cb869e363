"""A few frames of a drive, kept during a run for the figure of masks."""

from __future__ import annotations

from typing import Final

from roadeval.data import FrameResult, Role
from roadeval.report.images import ExampleFrame

SHOWN: Final = 4


class ExampleFrames:
    """Keeps a few frames that are spread evenly over a drive of ``total`` frames."""

    def __init__(self, total: int) -> None:
        self._due = [total * (2 * i + 1) / (2 * SHOWN) for i in range(SHOWN)]
        self.kept: Final[list[ExampleFrame]] = []

    def offer(self, position: int, result: FrameResult) -> None:
        """Keep the frame at ``position`` (from 1) if one is due and it is not a training frame."""
        if not self._due or position < self._due[0]:
            return
        if result.role in (Role.TRAINING, Role.COPY, Role.GAP):
            return
        self._due.pop(0)
        frame = result.frame
        masks = {v.variant: v.final() for v in result.variants}
        self.kept.append(ExampleFrame(frame.number, frame.image, frame.truth, masks).small())
