"""The cost of the presets' stages for a frame of 640x480, on one core."""

from __future__ import annotations

from statistics import median
from typing import Any, Final

from benchmarks.world import RenderSettings
from benchmarks.world.drive import render_drive
from roadeval.config.run import configure
from roadeval.data import Frame
from roadeval.pipeline.chain import Chain
from roadeval.pipeline.stage import View
from roadeval.runtime.threads import one_thread_each
from roadeval.training.learning import fit

TIMED: Final = 30
"""Number of frames, after the training frames."""
ROUNDS: Final = 3
TAUGHT: Final = 10
"""Frames, the first ones."""
PRESETS: Final = ("paper", "gated", "robust")


def measure() -> list[Any]:
    """Return each preset with its stages, in order, and the median of their milliseconds."""
    rendered = render_drive(RenderSettings(width=640, height=480))
    drive = [Frame(0, 0, 0, view.image, b"", truth=view.road) for view in rendered]
    with one_thread_each():
        return [[preset, _timed(drive, preset)] for preset in PRESETS]


def _timed(drive: list[Frame], preset: str) -> list[Any]:
    config = configure({"preset": preset})
    model = fit(drive[:TAUGHT], {"it": config.pipeline}, config.training)
    chain: Chain = config.pipeline.bind(model.parameters["it"])
    best = [_best(chain, frame) for frame in drive[-TIMED:]]
    return [[name, median(times[name] for times in best)] for name in best[0]]


def _best(chain: Chain, frame: Frame) -> dict[str, float]:
    """Return the milliseconds of each stage on a frame, the least of some rounds."""
    rounds = [_stages(chain, frame) for _ in range(ROUNDS)]
    return {name: 1000 * min(times[name] for times in rounds) for name in rounds[0]}


def _stages(chain: Chain, frame: Frame) -> dict[str, float]:
    """Return the seconds of each stage on a frame."""
    return {result.stage: result.seconds for result in chain.run(View.of(frame.image))}
