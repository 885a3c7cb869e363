"""The verdict: what a drive tells of the filter, and of looking at the image at all."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from roadeval.data import BASELINE, FILTERED
from roadeval.data.words import in_percent, plain_points
from roadeval.evaluation.differences import DriveDifferences, final_stages
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import Difference
from roadeval.results.certainty import Degree, degree_of

RATE: Final = "ERR"
NOTHING_SCORED: Final = "Nothing to score: no frame with truth was evaluated."
_BLIND: Final = f"{BASELINE}, which never looks at the image"


def verdict_of(
    totals: Mapping[str, Mapping[str, Any]],
    differences: DriveDifferences,
    settings: EvaluationSettings,
) -> str:
    """Return the verdict on a drive.

    Of a filter: what it changes, and whether the filtered variant beats the baseline. Where there
    is no pair to tell that from: whether the variant with the lowest error rate does.

    Parameters
    ----------
    totals
        By variant and stage; empty where nothing was scored.
    differences
        See `roadeval.evaluation.differences`.
    settings
        What is negligible.
    """
    if not totals:
        return NOTHING_SCORED
    stages = final_stages((variant, stage) for variant, own in totals.items() for stage in own)
    pair = differences.filter.get(stages.get(FILTERED, ""))
    sentences = [on_filter(pair[RATE], stages[FILTERED], settings)] if pair else []
    if differences.blind:
        name = FILTERED if pair else _lowest(differences)
        sentences.append(on_blind(differences.blind[name][RATE], name, settings))
    return " ".join(sentences) or _alone(totals, stages)


def on_filter(found: Difference, stage: str, settings: EvaluationSettings) -> str:
    """Return what the filter does to the error rate of a stage; ``found`` is with minus without."""
    what, here = f"{RATE} of {stage}", "On this drive the filter"
    verb, told = "raises" if found.mean > 0 else "lowers", _Told(found)
    sentences = {
        Degree.UNDEFINED: f"Nothing to compare: {what} is undefined on every frame.",
        Degree.FEW: f"Too few frames to tell whether the filter helps: {what} {told.few}.",
        Degree.SAME: f"{here} leaves {what} of every frame as it is.",
        Degree.SURE: f"{here} {verb} {what} by {told.size} {told.sizes}.",
        Degree.LITTLE: f"{here} has no effect on {what} larger than {told.bound}.",
        Degree.PROBABLE: f"{here} probably {verb} {what}, by {told.size} ({told.ends}).",
        Degree.UNKNOWN: f"Cannot tell whether the filter helps here: {what} {told.unknown}.",
    }
    return sentences[degree_of(found, settings)]


def on_blind(found: Difference, variant: str, settings: EvaluationSettings) -> str:
    """Return how a variant does against the baseline; ``found`` is the variant minus that."""
    better, relation = ("worse", "higher") if found.mean > 0 else ("better", "lower")
    told, than = _Told(found), f"{_BLIND}: its {RATE} is"
    sentences = {
        Degree.UNDEFINED: f"{RATE} of {variant} is undefined on every frame.",
        Degree.FEW: f"Too few frames to tell whether {variant} beats {_BLIND}: {RATE} {told.few}.",
        Degree.SAME: f"{variant} has the same {RATE} as {_BLIND}, on every frame.",
        Degree.SURE: f"{variant} is {better} than {than} {told.size} {relation} {told.sizes}.",
        Degree.LITTLE: f"{variant} is as good as {than} the same to within {told.bound}.",
        Degree.PROBABLE: (
            f"{variant} is probably {better} than {than} {told.size} {relation} ({told.ends})."
        ),
        Degree.UNKNOWN: f"Cannot tell whether {variant} beats {_BLIND}: {RATE} {told.unknown}.",
    }
    return sentences[degree_of(found, settings)]


class _Told:
    """The numbers of a difference as sentences need them, in percentage points."""

    def __init__(self, found: Difference) -> None:
        low, high = found.low or 0.0, found.high or 0.0
        self._digits = 1 if max(abs(found.mean), -low, high) >= 0.01 else 2
        self.size = f"{self._number(abs(found.mean))} pp"
        self.bound = f"{self._number(max(-low, high))} pp"
        ends = (low, high) if found.mean > 0 else (-high, -low)
        self.sizes = f"[{', '.join(map(self._number, ends))}]"
        self.ends = f"between {self._signed(low)} and {self._signed(high)} pp"
        here = f"{self._signed(found.mean)} on these {found.frames} frames"
        self.unknown = f"changes by {self.ends} ({here})"
        self.few = f"changes by {self._signed(found.mean)} pp on these {found.frames}"

    def _number(self, fraction: float) -> str:
        return f"{in_percent(fraction):.{self._digits}f}"

    def _signed(self, fraction: float) -> str:
        return plain_points(fraction, self._digits)


def _alone(totals: Mapping[str, Mapping[str, Any]], stages: Mapping[str, str]) -> str:
    """Return the error rates where nothing is there to compare them with."""
    rates = ", ".join(
        f"{in_percent(totals[variant][stage][RATE]):.1f} % with {variant}"
        for variant, stage in stages.items()
    )
    return f"{RATE} is {rates}; no frame with truth was trained on, so {BASELINE} is unknown."


def _lowest(differences: DriveDifferences) -> str:
    """Return the variant with the lowest error rate; one that is undefined comes last.

    A variant that has no masks of some frames is not held against those that have.
    """
    found = {name: rates[RATE] for name, rates in differences.blind.items()}
    most = max(each.frames for each in found.values())
    means = {name: each.mean for name, each in found.items() if each.frames == most}
    return min(means, key=lambda name: (math.isnan(means[name]), means[name]))
