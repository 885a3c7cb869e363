"""The verdict: a sentence that answers whether the filter helps on this drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from roadeval.data import FILTERED, FINAL_STAGE, UNFILTERED
from roadeval.evaluation.uncertainty import Difference

NOTHING_SCORED: Final = "Nothing to score: no frame with truth was evaluated."
NO_PAIR: Final = f"No verdict on a filter: {FILTERED} and {UNFILTERED} were not both run."


def verdict_of(
    totals: Mapping[str, Any], differences: Mapping[str, Mapping[str, Difference]]
) -> str:
    """Return the verdict on a drive.

    Parameters
    ----------
    totals
        By variant; empty where nothing was scored.
    differences
        Filtered minus unfiltered, by stage and rate.
    """
    if not totals:
        return NOTHING_SCORED
    if FINAL_STAGE not in differences:
        return NO_PAIR
    return verdict(differences[FINAL_STAGE]["ERR"], "ERR", FINAL_STAGE)


def verdict(difference: Difference, rate: str, stage: str) -> str:
    """Return what a difference, filtered minus unfiltered, of an error rate means.

    Parameters
    ----------
    difference
        Of a rate that is better when lower.
    rate, stage
        What it is the difference of, as ``ERR`` and ``post``.
    """
    what, mean = f"{rate} of {stage}", 100 * difference.mean
    if difference.frames == 0:
        return f"Nothing to compare: {what} is undefined on every frame."
    if difference.low is None or difference.high is None:
        moved = f"rose by {mean:.1f} pp" if mean > 0 else f"fell by {-mean:.1f} pp"
        return (
            f"Cannot tell whether the filter helps on this drive: {what} "
            f"{moved if mean else 'did not change'} on average, but {difference.reason}."
        )
    if difference.low == difference.high == 0:
        return f"On this drive the filter leaves {what} of every frame as it is."
    low, high = 100 * difference.low, 100 * difference.high
    if low > 0:
        return f"On this drive the filter raises {what} by {mean:.1f} pp [{low:.1f}, {high:.1f}]."
    if high < 0:
        return (
            f"On this drive the filter lowers {what} by {-mean:.1f} pp [{-high:.1f}, {-low:.1f}]."
        )
    return (
        f"On this drive the filter has no clear effect on {what}: "
        f"{mean:+.1f} pp [{low:+.1f}, {high:+.1f}]."
    )
