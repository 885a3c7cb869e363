"""A threshold on the probability of road: the one with the fewest errors on the training frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from roadeval.data import CERTAIN, Layer, Packed, Probability, best_code, histogram, mask_spec
from roadeval.pipeline import stage
from roadeval.pipeline.stage import NoSettings, Output, Stage, StageError, TrainingSet, View

THRESHOLD: Final = mask_spec("threshold", "Road above the threshold of the training frames")


@dataclass(frozen=True)
class Threshold:
    """The threshold with the fewest errors on the training frames."""

    code: int
    """Pixels with a greater code of probability, 0..65535, are road."""

    def __post_init__(self) -> None:
        stage.check_range("code", self.code, 0, CERTAIN)


def codes_of(opinion: Output | None) -> Probability:
    """Return the codes of probability of the stage before; a `StageError` if it has none."""
    if opinion is None or opinion.probability is None:
        raise StageError("threshold: the stage before it gives no probability of road")
    return opinion.probability


def fit(sample: TrainingSet, _settings: NoSettings) -> Threshold:
    """Choose the threshold with the fewest wrong pixels among all labelled ones."""
    pairs = zip(sample.opinions, sample.truths, strict=True)
    counts = [histogram(codes_of(opinion), truth) for opinion, truth in pairs]
    return Threshold(best_code(np.sum(counts, axis=0)))


@stage.per_view
def bind(_settings: NoSettings, learnt: Threshold, view: View) -> Output:
    """Return the pixels where road is more probable than the threshold."""
    road = Packed.of(codes_of(view.opinion) > learnt.code)
    facts = {"threshold": learnt.code / CERTAIN}
    return Output((Layer(THRESHOLD, road),), mask=road, facts=facts)


STAGE: Final = Stage(
    name="threshold",
    title="Threshold of the training frames",
    settings=NoSettings,
    bind=bind,
    layers=(THRESHOLD,),
    fit=fit,
    parameters=Threshold,
    hears=lambda _settings: True,
)
