"""The results of comparing two fleets: over all drives, on single ones, and on parts of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.evaluation.drives import AcrossDrives, Stratum
from roadeval.evaluation.uncertainty import Difference

Values = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Mask = tuple[str, str]
"""Variant and stage."""

TESTED: Final = "ERR"
"""The rate whose differences on single drives are tested."""
FALSE: Final = 0.05
"""The share of the drives called changed that may be false, on average."""


@dataclass(frozen=True, slots=True, eq=False)
class MaskFrames:
    """A mask's counts on a drive's evaluated frames, in the drive's order.

    Parameters
    ----------
    stamps
        ``(n,)`` int64 ns.
    counts
        ``(n, 4)`` int64: TP, TN, FP, FN.
    """

    stamps: Integers
    counts: Integers


@dataclass(frozen=True, slots=True, eq=False)
class MaskPair:
    """A drive's mask in both fleets, on the frames that both evaluated.

    Parameters
    ----------
    frames
        How many these are.
    base, new, difference
        ``(m,)`` in the order of `METRICS`: means of each fleet's rates, and of their paired
        differences, new minus base; NaN where undefined.
    base_counts, new_counts
        ``(4,)``: TP, TN, FP, FN of all frames together.
    tested
        The difference of `TESTED` with its interval; None where it was not asked for.
    """

    frames: int
    base: Values
    new: Values
    difference: Values
    base_counts: Integers
    new_counts: Integers
    tested: Difference | None


@dataclass(frozen=True, slots=True, eq=False)
class DrivePair:
    """A drive in both fleets.

    Parameters
    ----------
    drive
        Its identity in the new fleet.
    group
        What it shares with other drives; its own identity where it has none.
    masks
        Those that both fleets have of it.
    base_left_out, new_left_out
        Frames that only the other fleet has not evaluated.
    truth_differs
        Frames whose truth is another in both.
    """

    drive: str
    group: str
    masks: Mapping[Mask, MaskPair]
    base_left_out: int
    new_left_out: int
    truth_differs: int


@dataclass(frozen=True, slots=True)
class FleetChange:
    """How a mask changed over all drives that have it in both fleets.

    Parameters
    ----------
    variant, stage, final
        Whose mask, and whether it is its last one.
    drives
        How many have it.
    base, new
        Means over drives of the mean rates; ``pooled_*`` and those of the overlap are of all
        drives' pixels together.
    difference
        New minus base over drives, by rate.
    p_holm, comparisons
        Of ERR, after Holm's correction for the masks that were compared; None together.
    """

    variant: str
    stage: str
    final: bool
    drives: int
    base: Mapping[str, float]
    new: Mapping[str, float]
    difference: Mapping[str, AcrossDrives]
    p_holm: float | None = None
    comparisons: int | None = None


@dataclass(frozen=True, slots=True)
class DriveChange:
    """How the ERR of a final mask changed on one drive; ``q`` is ``p`` after the correction."""

    drive: str
    variant: str
    stage: str
    frames: int
    base: float
    new: float
    mean: float
    low: float | None
    high: float | None
    p: float | None
    q: float | None

    @property
    def changed(self) -> bool:
        """Whether it is among the drives that are called changed."""
        return self.q is not None and self.q <= FALSE


@dataclass(frozen=True, slots=True)
class FleetStratum:
    """How the ERR of a final mask changed on a part of the drives."""

    variant: str
    stage: str
    stratum: Stratum
