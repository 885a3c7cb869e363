"""The differences that a run states: filtered minus unfiltered, and each variant minus blind."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from roadeval.data import BASELINE, FILTERED, FINAL_STAGE, UNFILTERED
from roadeval.evaluation.frame_counts import FrameCounts
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import Difference, holm, mean_difference

ByRate = dict[str, Difference]

TESTED: Final = "ERR"
"""The rate whose differences are findings. Those of the final masks are a family, and corrected for
their number; other rates and stages say where a finding comes from, and are not corrected."""


@dataclass(frozen=True, slots=True)
class DriveDifferences:
    """Paired differences of a drive's masks, each by rate.

    Parameters
    ----------
    filter
        Filtered minus unfiltered, by stage; empty where one of the two was not run.
    blind
        The final mask minus the baseline, by variant; empty where there is no baseline.
    """

    filter: Mapping[str, ByRate]
    blind: Mapping[str, ByRate]

    def as_dict(self) -> dict[str, Any]:
        """Return them as parts of ``summary.json``."""
        return {
            name: {key: {r: asdict(each) for r, each in rates.items()} for key, rates in of.items()}
            for name, of in (("difference", self.filter), ("against_blind", self.blind))
        }


def drive_differences(
    masks: Sequence[FrameCounts], settings: EvaluationSettings
) -> DriveDifferences:
    """Compute the differences of a drive, on the frames that both masks of a pair have."""
    by_name = {(mask.variant, mask.stage): mask for mask in masks}
    filters = {
        stage: _rates(mask, by_name[UNFILTERED, stage], settings)
        for (variant, stage), mask in by_name.items()
        if variant == FILTERED and (UNFILTERED, stage) in by_name
    }
    stages = final_stages(by_name)
    finals = {name: by_name[name, stage] for name, stage in stages.items()}
    blind = finals.pop(BASELINE, None)
    against = (
        {}
        if blind is None
        else {name: _rates(mask, blind, settings) for name, mask in finals.items()}
    )
    final = stages.get(FILTERED, "")
    family = [*([filters[final]] if final in filters else []), *against.values()]
    for rates, corrected in zip(family, holm([rates[TESTED] for rates in family]), strict=True):
        rates[TESTED] = corrected
    return DriveDifferences(filters, against)


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
        rate: mean_difference(rates[:, column], base[:, column], settings)
        for column, rate in enumerate(METRICS)
        if rate in COMPARED
    }
