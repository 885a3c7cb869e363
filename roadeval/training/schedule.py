"""The role of each frame of a run: training, copy of such, gap, evaluated, unlabelled."""

from __future__ import annotations

from dataclasses import dataclass

from roadeval.data import Frame, Role
from roadeval.training.likeness import Alike, Likeness


@dataclass(frozen=True, slots=True)
class Use:
    """What a frame is used for, and which training frames of a model file show its place."""

    role: Role
    beside: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True)
class Schedule:
    """What each frame of a run is used for."""

    digests: frozenset[str]
    """Hashes of the frames that trained the model."""
    gap: frozenset[int] = frozenset()
    """Numbers of the frames after them that are left out as well."""
    first: int | None = None
    """Number of the first frame to evaluate, where it is known beforehand."""
    sizes: frozenset[int] | None = None
    """Bytes that the training frames take as logged, where they are known: a frame of another size
    is none of them, and need not be hashed.
    """
    likeness: Likeness | None = None
    """The pictures of the training frames, where these come from a file: a frame that shows the
    same is not evaluated. In the log that trains its own model a frame after the training frames is
    another one, however alike.
    """

    def use(self, frame: Frame) -> Use:
        """Return what a decoded frame is used for."""
        alike = Alike() if self.likeness is None else self.likeness.of(frame.image)
        return Use(self._role(frame, alike), alike.beside)

    def _role(self, frame: Frame, alike: Alike) -> Role:
        may_be = self.sizes is None or len(frame.payload) in self.sizes
        if may_be and frame.digest() in self.digests:
            return Role.TRAINING
        if alike.same:
            return Role.COPY
        if frame.number in self.gap:
            return Role.GAP
        return Role.UNLABELLED if frame.truth is None else Role.EVALUATED
