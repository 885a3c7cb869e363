"""The threshold on how probable road is, chosen where training frames have the fewest errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from roadeval.data import CERTAIN, Layer, Packed, Probability, best_code, histogram, mask_spec
from roadeval.pipeline.stage import (
    Output,
    Stage,
    StageError,
    TrainingSet,
    View,
    check_range,
    per_view,
    stage_settings,
)

THRESHOLD: Final = mask_spec("threshold", "Road above the threshold of the training frames")


@stage_settings
class ThresholdSettings:
    """The threshold has no settings: all labelled pixels of the training frames decide."""


@dataclass(frozen=True)
class Threshold:
    """What the training frames chose."""

    code: int
    """Road is what is more probable, 0..65535."""

    def __post_init__(self) -> None:
        check_range("code", self.code, 0, CERTAIN)


def codes_of(opinion: Output | None) -> Probability:
    """Return how probable road is by the stage before; a `StageError` if that does not say so."""
    if opinion is None or opinion.probability is None:
        raise StageError("threshold: the stage before does not say how probable road is")
    return opinion.probability


def fit(sample: TrainingSet, _settings: ThresholdSettings) -> Threshold:
    """Choose the threshold with the fewest wrong pixels, of all that are labelled."""
    pairs = zip(sample.opinions, sample.truths, strict=True)
    counts = [histogram(codes_of(opinion), truth) for opinion, truth in pairs]
    return Threshold(best_code(np.sum(counts, axis=0)))


@per_view
def bind(_settings: ThresholdSettings, learnt: Threshold, view: View) -> Output:
    """Return where road is more probable than that by the stage before."""
    road = Packed.of(codes_of(view.opinion) > learnt.code)
    facts = {"threshold": learnt.code / CERTAIN}
    return Output((Layer(THRESHOLD, road),), mask=road, facts=facts)


STAGE: Final = Stage(
    name="threshold",
    title="Threshold of the training frames",
    settings=ThresholdSettings,
    bind=bind,
    layers=(THRESHOLD,),
    fit=fit,
    parameters=Threshold,
    hears=lambda _settings: True,
)
