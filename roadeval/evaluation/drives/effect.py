"""Paired differences of a rate, one a drive, and the drives that belong together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DriveEffect:
    """A paired difference of a rate on one drive, new minus base. Fractions.

    Parameters
    ----------
    drive
        Its identity.
    group
        What it shares with other drives, as a day or a route; its own identity where it has none.
    mean
        Of the frames' differences; NaN if no frame has one, and the drive is left out.
    frames
        With a difference.
    base_counts, new_counts
        What the rate is the ratio of, summed over those frames: for ERR wrong and labelled pixels.
        None where unknown.
    """

    drive: str
    group: str
    mean: float
    frames: int
    base_counts: tuple[int, int] | None = None
    new_counts: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """Drives sorted by their group and identity, whatever order they came in.

    Parameters
    ----------
    effects
        The n drives with a mean.
    means
        ``(n,)``: those means.
    sizes
        ``(c,)``: how many drives each group has, in the groups' order.
    """

    effects: tuple[DriveEffect, ...]
    means: Values
    sizes: npt.NDArray[np.int64]

    @classmethod
    def of(cls, effects: Iterable[DriveEffect]) -> Clusters:
        """Sort drives, and leave out those without a mean."""
        known = sorted(
            (each for each in effects if not np.isnan(each.mean)),
            key=lambda each: (each.group, each.drive),
        )
        _, sizes = np.unique([each.group for each in known], return_counts=True)
        return cls(tuple(known), np.array([each.mean for each in known], np.float64), sizes)

    def __len__(self) -> int:
        """Return the number of groups."""
        return len(self.sizes)

    @property
    def starts(self) -> npt.NDArray[np.int64]:
        """``(c,)``: where each group's drives begin."""
        return np.cumsum(self.sizes) - self.sizes

    def sums(self, values: Values) -> Values:
        """Return the sums of the drives' values, ``(n, ...)``, in each group, ``(c, ...)``."""
        summed: Values = np.add.reduceat(values, self.starts, axis=0)
        return summed

    def group_means(self) -> Values:
        """Return the mean of each group's drives, ``(c,)``."""
        return self.sums(self.means) / self.sizes
