"""The role of each frame of a run: training, gap, evaluated, unlabelled."""

from __future__ import annotations

from dataclasses import dataclass

from roadeval.data import Frame, Role


@dataclass(frozen=True, slots=True)
class Schedule:
    """What each frame of a run is used for.

    Parameters
    ----------
    digests
        Hashes of the frames that trained the model.
    gap
        Numbers of the frames after them that are left out as well.
    first
        Number of the first frame to evaluate, where it is known beforehand.
    sizes
        Bytes that the training frames take as logged, where they are known: a frame of another
        size is none of them, and need not be hashed.
    """

    digests: frozenset[str]
    gap: frozenset[int] = frozenset()
    first: int | None = None
    sizes: frozenset[int] | None = None

    def role(self, frame: Frame) -> Role:
        """Return what a decoded frame is used for."""
        may_be = self.sizes is None or len(frame.payload) in self.sizes
        if may_be and frame.digest() in self.digests:
            return Role.TRAINING
        if frame.number in self.gap:
            return Role.GAP
        return Role.UNLABELLED if frame.truth is None else Role.EVALUATED
