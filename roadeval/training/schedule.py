"""The role of each frame of a run: training, gap, evaluated, picked or unlabelled."""

from __future__ import annotations

from dataclasses import dataclass

from roadeval.data import Frame, Role
from roadeval.logs import Picks, Why


@dataclass(frozen=True, slots=True)
class Schedule:
    """What each frame of a run is used for."""

    digests: frozenset[str]
    """Hashes of the frames that trained the model."""
    gap: frozenset[int] = frozenset()
    """Numbers of the frames after them that are left out as well."""
    first: int | None = None
    """Number of the first frame to evaluate, where it is known beforehand."""
    picks: Picks | None = None
    """Which frames were picked to be labelled: those that were drawn at random are evaluated."""

    def role(self, frame: Frame) -> Role:
        """Return what a decoded frame is used for."""
        if frame.digest() in self.digests:
            return Role.TRAINING
        if frame.number in self.gap:
            return Role.GAP
        if frame.truth is None:
            return Role.UNLABELLED
        if self.picks is not None:
            if self.picks.is_proposal(frame.stamp_ns, frame.truth):
                return Role.UNLABELLED
            if frame.stamp_ns not in self.picks.stamps_of(Why.RANDOM):
                return Role.PICKED
        return Role.EVALUATED
