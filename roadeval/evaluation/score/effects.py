"""A drive's differences, every variant minus ``unfiltered`` and minus ``blind``; its claims.

The paper gives no number for figures 3a and 3b, and their curves are lost. What is left are claims
that one mask is wrong less often than another; each window of ten frames bears one out or does not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from roadeval.data import BASELINE, FILTERED, FINAL_STAGE, UNFILTERED
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.score.counts import FrameCounts, Name, Window
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import Difference, holm, within_drive

TESTED: Final = "ERR"
"""The rate whose differences are findings. Those of the final masks against one base are a family,
and corrected for their number; other rates and stages say where a finding comes from."""
BASES: Final = (UNFILTERED, BASELINE)


@dataclass(frozen=True, slots=True)
class Effect:
    """The paired differences of two masks of a drive, on the frames that both have."""

    base: str
    """The variant that is subtracted, one of `BASES`."""
    base_stage: str
    variant: str
    stage: str
    """Whose mask."""
    final: bool
    """Whether both are final masks."""
    rates: Mapping[str, Difference]


def drive_effects(masks: Sequence[FrameCounts], settings: EvaluationSettings) -> list[Effect]:
    """Compute the differences of a drive: of final masks, and of the filter stage by stage."""
    by_name = {(mask.variant, mask.stage): mask for mask in masks}
    finals = final_stages(by_name)
    found = []
    for base in (base for base in BASES if base in finals):
        family = []
        for variant, last in finals.items():
            if variant in (base, BASELINE):
                continue
            for stage in (stage for name, stage in by_name if name == variant):
                final = stage == last
                base_stage = finals[base] if final else stage
                of_filter = (base, variant) == (UNFILTERED, FILTERED)
                if final or (of_filter and (base, stage) in by_name):
                    new, old = by_name[variant, stage].paired(by_name[base, base_stage])
                    rates = {
                        rate: within_drive(
                            *(new[:, column], old[:, column], settings),
                            higher_is_better=metric.higher_is_better,
                        )
                        for column, (rate, metric) in enumerate(METRICS.items())
                        if rate in COMPARED
                    }
                    family.append(Effect(base, base_stage, variant, stage, final, rates))
        found += corrected(family)
    return found


def corrected(effects: Sequence[Effect]) -> list[Effect]:
    """Correct the final masks' differences of `TESTED`, all against one base, for their number."""
    family = iter(holm([each.rates[TESTED] for each in effects if each.final]))
    return [
        replace(each, rates={**each.rates, TESTED: next(family)}) if each.final else each
        for each in effects
    ]


def final_stages(masks: Iterable[Name]) -> dict[str, str]:
    """Return each variant's final stage: ``post``, or the last that it has.

    ``masks`` are in the order in which the stages ran.
    """
    finals: dict[str, str] = {}
    for variant, stage in masks:
        if finals.get(variant) != FINAL_STAGE:
            finals[variant] = stage
    return finals


_WITH: Final = (FILTERED, FINAL_STAGE)
_WITHOUT: Final = (UNFILTERED, FINAL_STAGE)
CLAIMS: Final[Mapping[str, tuple[str, Name, Name]]] = {
    **{f"filter_{rate}": (rate, _WITH, _WITHOUT) for rate in ("ERR", "FPR", "FNR")},
    "svm_ERR": ("ERR", (FILTERED, "svm"), (FILTERED, "similarity")),
    "post_ERR": ("ERR", _WITH, (FILTERED, "svm")),
}
"""By the key in ``summary.json``: the rate that is lower for the first mask than for the second.

Section 5 claims so of the filter, section 4.3 of the SVM, section 4.4 of the post-processing."""


def evidence(windows: Iterable[Window], size: int) -> dict[str, dict[str, int]]:
    """Count the windows that bear out each claim whose masks the drive has; equal rates do not.

    By claim: how many full ``windows``, of ``size`` frames in both masks, have both rates, and in
    how many it ``held``; ``short`` and ``short_held`` are of windows with fewer frames.
    """
    masks: dict[Name, dict[int, Window]] = {}
    for window in windows:
        masks.setdefault((window.variant, window.stage), {})[window.number] = window
    found = {}
    for name, (rate, better, worse) in CLAIMS.items():
        if better in masks and worse in masks:
            counted = dict.fromkeys(("held", "windows", "short_held", "short"), 0)
            for number in masks[better].keys() & masks[worse].keys():
                mine, other = masks[better][number], masks[worse][number]
                full = min(mine.frames, other.frames) == size
                difference = mine.rates[rate] - other.rates[rate]
                counted["windows" if full else "short"] += not math.isnan(difference)
                counted["held" if full else "short_held"] += difference < 0
            found[name] = counted
    return found
