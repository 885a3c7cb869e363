"""A drive's differences: every variant minus ``unfiltered``, and minus ``blind``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from roadeval.data import BASELINE, FILTERED, FINAL_STAGE, UNFILTERED
from roadeval.evaluation.frame_counts import FrameCounts
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import Difference, holm, within_drive

ByRate = Mapping[str, Difference]

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
    rates: ByRate


def drive_effects(masks: Sequence[FrameCounts], settings: EvaluationSettings) -> list[Effect]:
    """Compute the differences of a drive: of final masks, and of the filter stage by stage."""
    by_name = {(mask.variant, mask.stage): mask for mask in masks}
    finals = final_stages(by_name)

    def effect(variant: str, stage: str, base: str, base_stage: str) -> Effect:
        rates = _rates(by_name[variant, stage], by_name[base, base_stage], settings)
        final = (stage, base_stage) == (finals[variant], finals[base])
        return Effect(base, base_stage, variant, stage, final, rates)

    found = []
    for base in (base for base in BASES if base in finals):
        family = []
        for variant, last in finals.items():
            if variant in (base, BASELINE):
                continue
            for stage in (stage for name, stage in by_name if name == variant):
                if stage == last:
                    family.append(effect(variant, stage, base, finals[base]))
                elif (base, variant) == (UNFILTERED, FILTERED) and (base, stage) in by_name:
                    family.append(effect(variant, stage, base, stage))
        found += corrected(family)
    return found


def corrected(effects: Sequence[Effect]) -> list[Effect]:
    """Correct the final masks' differences of `TESTED`, all against one base, for their number."""
    family = iter(holm([each.rates[TESTED] for each in effects if each.final]))
    return [
        replace(each, rates={**each.rates, TESTED: next(family)}) if each.final else each
        for each in effects
    ]


def as_parts(effects: Iterable[Effect]) -> dict[str, Any]:
    """Return them as parts of ``summary.json``.

    ``difference`` is that of the filter, by stage; ``against_unfiltered`` that of the other
    variants' final masks, and ``against_blind`` that of all, by variant.
    """
    parts: dict[str, Any] = {"difference": {}, "against_unfiltered": {}, "against_blind": {}}
    for each in effects:
        rates = {rate: asdict(difference) for rate, difference in each.rates.items()}
        if each.base == BASELINE:
            parts["against_blind"][each.variant] = rates
        elif each.variant == FILTERED:
            parts["difference"][each.stage] = rates
        else:
            parts["against_unfiltered"][each.variant] = rates
    return parts


def final_stages(masks: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return each variant's final stage: ``post``, or the last that it has.

    Parameters
    ----------
    masks
        Variant and stage of each mask, in the order in which the stages ran.
    """
    finals: dict[str, str] = {}
    for variant, stage in masks:
        if finals.get(variant) != FINAL_STAGE:
            finals[variant] = stage
    return finals


def _rates(treated: FrameCounts, control: FrameCounts, settings: EvaluationSettings) -> ByRate:
    _, mine, theirs = np.intersect1d(treated.positions, control.positions, return_indices=True)
    rates, base = treated.rates[mine], control.rates[theirs]
    return {
        rate: within_drive(rates[:, column], base[:, column], settings)
        for column, rate in enumerate(METRICS)
        if rate in COMPARED
    }
