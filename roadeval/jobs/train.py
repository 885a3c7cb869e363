"""Train a model on some drives, for use on others."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from roadeval import logs
from roadeval.config import RunConfig
from roadeval.data import Frame
from roadeval.jobs import learning
from roadeval.jobs.outputs import AnyPath, keep_apart
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.run import select, span
from roadeval.kernels.first_time import prepare
from roadeval.training import Model, save_model


def train(
    drives: Sequence[AnyPath],
    output: AnyPath,
    config: RunConfig | None = None,
    *,
    on_progress: OnProgress = ignore,
) -> Model:
    """Train every variant on some drives, and write the model file.

    From each drive ``training.frames`` labelled frames are taken, spread evenly over the
    selected range. Frames without truth are taken where ``training.source`` is ``patch``, or
    ``auto`` and no drive has truth.

    Raises
    ------
    RoadevalError
        If some drives have truth and others none, or there is nothing to learn.
    """
    config = config or RunConfig()
    keep_apart(drives, (output,))
    settings = config.training
    total, by_truth = settings.frames * len(drives), settings.source != "patch"
    memory = learning.Memory()
    frames: dict[Path, list[Frame]] = {}
    for drive in drives:
        with logs.open_log(drive, keep_corrupt=config.frames.keep_corrupt) as log:
            there = partial(log.frames, select(log, config), span(config))
            prepare(lambda: on_progress(Progress(0, total, "compiling")))
            frames[log.path] = []
            for frame in learning.spread(there, settings.frames, labelled=by_truth):
                frames[log.path].append(memory.hold(frame))
                on_progress(Progress(memory.frames, total, "training"))
    model = learning.from_drives(frames, config.variants(), settings)
    save_model(model, Path(output))
    return model
