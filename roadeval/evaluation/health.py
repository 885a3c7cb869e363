"""A variant's health on a frame: ok, degraded or failed."""

from __future__ import annotations

from collections.abc import Mapping

from roadeval.data import Health
from roadeval.evaluation.settings import EvaluationSettings

Rates = Mapping[str, float]


def judge(rates: Rates, blind: Rates | None, settings: EvaluationSettings) -> Health:
    """Return a variant's health by its final mask's rates and the baseline's, if there is one.

    An undefined rate counts neither for nor against it. The thresholds and their reasons stand in
    `EvaluationSettings`.
    """
    if rates["ERR"] >= settings.failed_err or rates["FNR"] >= settings.failed_fnr:
        return Health.FAILED
    worse = blind is not None and rates["ERR"] - blind["ERR"] > settings.degraded_margin
    if worse or rates["ERR"] >= settings.degraded_err:
        return Health.DEGRADED
    return Health.OK
