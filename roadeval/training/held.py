"""Training frames, held decoded within a bound on memory."""

from __future__ import annotations

from typing import Final

from roadeval.data import Frame

GREATEST_MEMORY: Final = 2 << 30
"""Bytes that the training frames of a run may take."""


class HeldFrames:
    """The training frames of a run: decoded, all of them, as long as it trains."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.is_full = False
        self._bytes = 0

    def add(self, frame: Frame) -> bool:
        """Hold a frame if there is room for it; return whether there was."""
        masks = [frame.truth, frame.shadow_truth, *frame.external.values()]
        # Two filters in a row leave two more images of each frame while a variant is fitted.
        size = 3 * frame.image.nbytes + sum(mask.nbytes for mask in masks if mask is not None)
        size += len(frame.payload)
        self.is_full = self._bytes + size > GREATEST_MEMORY
        if not self.is_full:
            self._bytes += size
            self.frames.append(frame)
        return not self.is_full

    def full(self) -> str:
        """Return why no more frames can be held."""
        return (
            f"training holds its frames decoded, and more than {len(self.frames)} of them would "
            f"take over {GREATEST_MEMORY >> 20} MiB"
        )
