"""How much of the true shadow on synthetic roads the filters find, and how much of what they find.

As in a replay the first frames train, and the others are scored.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from benchmarks.world import RenderSettings
from benchmarks.world.drive import SynthFrame, render_drive
from roadeval.config.run import configure
from roadeval.data import ROAD, Frame
from roadeval.pipeline.stage import View
from roadeval.training.learning import fit

SEEDS: Final = (0, 1, 2)
TRAINING: Final = 10
PRESETS: Final = {"paper": "shadow", "gated": "gated"}
"""Presets, and the stage that is their filter."""


def measure() -> dict[str, Any]:
    """Return precision and recall of each filter on each drive, pooled over its frames."""
    by_preset: dict[str, Any] = {}
    for seed in SEEDS:
        drive = list(render_drive(RenderSettings(seed=seed)))
        for preset, stage in PRESETS.items():
            by_preset.setdefault(preset, {})[f"synthetic_{seed}"] = rates_on(drive, preset, stage)
    return by_preset


def rates_on(drive: list[SynthFrame], preset: str, stage: str) -> dict[str, float]:
    """Return precision and recall of a filter's shadow; recall on road and on all of it."""
    config = configure({"preset": preset})
    frames = [Frame(0, 0, 0, f.image, b"", truth=f.road) for f in drive[:TRAINING]]
    model = fit(frames, {"it": config.pipeline}, config.training)
    chain = config.pipeline.bind(model.parameters["it"])
    totals = np.zeros(5)
    for frame in drive[TRAINING:]:
        output = next(r.output for r in chain.run(View.of(frame.image)) if r.stage == stage)
        shadow = output.regions["shadow"].pixels() > 0
        true, road = frame.shadow > 0, frame.road == ROAD
        sets = (shadow & true, shadow, true, shadow & true & road, true & road)
        totals += [part.sum() for part in sets]
    both, called, true_count, on_road, road_count = totals
    return {
        "precision": both / max(called, 1),
        "recall": both / max(true_count, 1),
        "recall_on_road": on_road / max(road_count, 1),
    }
