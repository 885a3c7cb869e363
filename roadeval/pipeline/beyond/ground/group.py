"""A group of features: one idea of what tells road from the rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.scene import Scene


@dataclass(frozen=True, slots=True)
class Group:
    """Features that are computed together.

    Parameters
    ----------
    name
        As settings name it.
    names
        Those of its features, in order.
    compute
        Returns each of them, ``(h, w)`` float32 or what NumPy spreads to that.
    """

    name: str
    names: tuple[str, ...]
    compute: Callable[[Scene], Sequence[Values]]
