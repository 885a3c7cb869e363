"""Train a model on some drives, for use on others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from roadeval import logs
from roadeval.config import pipelines_of
from roadeval.data import Frame
from roadeval.jobs.options import Progress, ReplayOptions, keep_apart
from roadeval.kernels import prepare
from roadeval.training import Model, TrainingError, learning, save_model
from roadeval.training.held import HeldFrames


def train(
    drives: Sequence[str | Path],
    output: str | Path,
    *,
    options: ReplayOptions | None = None,
    on_progress: Callable[[Progress], None] | None = None,
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
    options, tell = options or ReplayOptions(), on_progress or _silent
    keep_apart(drives, (output,))
    settings = options.training()
    total, by_truth = settings.frames * len(drives), settings.source != "patch"
    held = HeldFrames()
    frames: dict[Path, list[Frame]] = {}
    for drive in drives:
        with logs.open_log(drive, keep_corrupt=options.keep_corrupt) as log:
            there = partial(log.frames, options.select(log), options.span())
            prepare(lambda: tell(Progress(0, total, "compiling")))
            frames[log.path] = []
            for frame in learning.spread(there, settings.frames, labelled=by_truth):
                if not held.add(frame):
                    raise TrainingError(
                        f"{held.full()}; lower training.frames, or reduce them with frames.scale"
                    )
                frames[log.path].append(frame)
                tell(Progress(len(held.frames), total, "training"))
    model = learning.from_drives(frames, pipelines_of(options.all_variants()), settings)
    save_model(model, Path(output))
    return model


def _silent(_progress: Progress) -> None:
    """Tell nobody."""
