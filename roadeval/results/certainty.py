"""How sure a difference is, by degrees."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum, auto
from typing import Any, Final

from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import Difference

PROBABLY: Final = 0.2
"""The greatest p-value of a difference that is called probable: where there is none, one drive in
ten shows so large a one in that direction."""


MARK: Final = "*"
"""On a difference that stands when all that are told together are corrected for."""


class Degree(Enum):
    """How sure a difference is."""

    UNDEFINED = auto()
    """No frame has it."""
    FEW = auto()
    """Too few frames have it for an interval."""
    SAME = auto()
    """It is 0 on every frame."""
    SURE = auto()
    """It is there, and its direction is known."""
    LITTLE = auto()
    """If it is there, it is negligible."""
    PROBABLE = auto()
    """It is probably there, in its direction."""
    UNKNOWN = auto()
    """It may be there or not, in either direction."""


def degree_of(difference: Difference, settings: EvaluationSettings) -> Degree:
    """Return what is known of a difference, by its corrected p-value where it has one."""
    p = difference.p if difference.p_holm is None else difference.p_holm
    return degree(
        difference.frames,
        difference.low,
        difference.high,
        p,
        confidence=difference.confidence,
        negligible=settings.negligible,
    )


def degree(
    count: int,
    low: float | None,
    high: float | None,
    p: float | None,
    *,
    confidence: float,
    negligible: float,
) -> Degree:
    """Return what is known of a difference of so many frames, or drives.

    ``low`` and ``high`` are the ends of its interval, ``p`` the probability of one as large by
    chance; None where there are too few.
    """
    if not count:
        return Degree.UNDEFINED
    if low is None or high is None or p is None:
        return Degree.FEW
    if low == high == 0:
        return Degree.SAME
    if p < 1 - confidence:
        return Degree.SURE
    if max(-low, high) <= negligible:
        return Degree.LITTLE
    return Degree.PROBABLE if p <= PROBABLY else Degree.UNKNOWN


def stands(p_holm: float | None, confidence: float) -> bool:
    """Return whether a difference stands after Holm's correction."""
    return p_holm is not None and p_holm < 1 - confidence


def correction(changes: Iterable[Mapping[str, Any]]) -> str:
    """Return what a mark on differences of ERR means; empty where none was corrected.

    Parameters
    ----------
    changes
        The differences, as in ``summary.json``.
    """
    counts = {change["comparisons"] for change in changes if change.get("comparisons")}
    if not counts:
        return ""
    (count,) = counts
    return (
        f"{MARK} stands after Holm's correction for the {count} differences of ERR; other rates "
        "are not corrected."
        if count > 1
        else f"{MARK} leaves out 0; it is the only one, so nothing is corrected."
    )


def too_few(frames: int) -> str:
    """Return why a difference has no interval."""
    return f"{frames} frame{' is' if frames == 1 else 's are'} too few for an interval"
