"""Pipelines with something learnt, as each preset has them."""

import numpy as np

from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.stage import TrainingSet
from roadeval.pipeline.stages import STAGES, stages_of
from tests.pipeline.images import noise

NAMES = ("shadow", "similarity", "svm", "post")
SETTINGS = {
    "paper": {name: STAGES[name].settings() for name in NAMES},
    "printed": {
        "shadow": STAGES["shadow"].settings(
            threshold="printed", inclusive=True, statistic="printed", colour_space="hsi"
        ),
        "similarity": STAGES["similarity"].settings(),
        "svm": STAGES["svm"].settings(kernel="linear"),
        "post": STAGES["post"].settings(operations=("close", "open")),
    },
}


def default(*chain):
    """A pipeline of some stages with their default settings."""
    return Pipeline(chain, {stage.name: stage.settings() for stage in stages_of(chain)})


def fitted(settings):
    rng = np.random.default_rng(0)
    grey = rng.normal(110, 20, (60, 1)) + rng.normal(0, 6, (60, 3))
    colours = np.concatenate([np.clip(grey, 0, 255).astype(np.uint8), noise(1, 60)[0]])
    where = np.zeros(120, np.intp)
    sample = TrainingSet((colours[None],), where, where, np.arange(120), np.arange(120) < 60)
    return {name: STAGES[name].fit(sample, settings[name]) for name in ("similarity", "svm")}


def chain_of(names, settings):
    """A chain of some stages, with what `fitted` learns."""
    return Pipeline(tuple(names), settings).bind(fitted(settings))
