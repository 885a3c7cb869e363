"""The paper's claims on its figures and phases, counted in a drive's windows.

Its text gives no number for figures 3a and 3b, and their curves are lost. What is left are claims
that one mask is wrong less often than another; each window of ten frames bears one out or does not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from roadeval.data import FILTERED, FINAL_STAGE, UNFILTERED
from roadeval.evaluation.frame_counts import Window


@dataclass(frozen=True, slots=True)
class Claim:
    """The claim that a rate of one mask is lower than that of another."""

    name: str
    """Its key in ``summary.json``."""
    rate: str
    """Which rate."""
    better: tuple[str, str]
    worse: tuple[str, str]
    """Variant and stage of the masks."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """In how many windows a claim is borne out."""

    held: int
    windows: int
    """Of the full windows in which both rates are defined."""
    short_held: int
    short: int
    """The same of windows with fewer frames, as the last one may be."""


_WITH: Final = (FILTERED, FINAL_STAGE)
_WITHOUT: Final = (UNFILTERED, FINAL_STAGE)

CLAIMS: Final = (
    *(Claim(f"filter_{rate}", rate, _WITH, _WITHOUT) for rate in ("ERR", "FPR", "FNR")),
    Claim("svm_ERR", "ERR", (FILTERED, "svm"), (FILTERED, "similarity")),
    Claim("post_ERR", "ERR", (FILTERED, FINAL_STAGE), (FILTERED, "svm")),
)
"""Section 5 for the filter, section 4.3 for the SVM, section 4.4 for the post-processing."""


def evidence(windows: Iterable[Window], size: int) -> dict[str, Evidence]:
    """Count the windows that bear out each claim; equal rates do not.

    Parameters
    ----------
    windows
        Of every mask of a drive.
    size
        Frames in a full window.

    Returns
    -------
    dict
        By the claims' names, without those whose masks the drive has not.
    """
    masks: dict[tuple[str, str], dict[int, Window]] = {}
    for window in windows:
        masks.setdefault((window.variant, window.stage), {})[window.number] = window
    return {
        claim.name: _of(claim.rate, masks[claim.better], masks[claim.worse], size)
        for claim in CLAIMS
        if claim.better in masks and claim.worse in masks
    }


def _of(rate: str, better: dict[int, Window], worse: dict[int, Window], size: int) -> Evidence:
    held: dict[bool, list[bool]] = {True: [], False: []}
    for number in sorted(better.keys() & worse.keys()):
        mine, other = better[number], worse[number]
        difference = mine.rates[rate] - other.rates[rate]
        if not math.isnan(difference):
            held[min(mine.frames, other.frames) == size].append(difference < 0)
    return Evidence(sum(held[True]), len(held[True]), sum(held[False]), len(held[False]))
