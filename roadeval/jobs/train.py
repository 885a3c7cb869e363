"""Train a model on some drives, for use on others."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from roadeval import logs
from roadeval.config import RunConfig
from roadeval.data import Frame
from roadeval.jobs.outputs import AnyPath, keep_apart
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.kernels import prepare
from roadeval.training import Model, TrainingError, learning, save_model
from roadeval.training.held import HeldFrames


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
    held = HeldFrames()
    frames: dict[Path, list[Frame]] = {}
    for drive in drives:
        with logs.open_log(drive, keep_corrupt=config.frames.keep_corrupt) as log:
            selection = log.select(config.topics, config.labels, scale=config.frames.scale)
            there = partial(log.frames, selection, logs.Span.of(config.frames))
            prepare(lambda: on_progress(Progress(0, total, "compiling")))
            frames[log.path] = []
            for frame in learning.spread(there, settings.frames, labelled=by_truth):
                if not held.add(frame):
                    raise TrainingError(
                        f"{held.full()}; lower `training.frames`, or reduce them with "
                        "`frames.scale`"
                    )
                frames[log.path].append(frame)
                on_progress(Progress(len(held.frames), total, "training"))
    model = learning.from_drives(frames, config.pipelines(), settings)
    save_model(model, Path(output))
    return model
