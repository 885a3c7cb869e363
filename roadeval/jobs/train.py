"""Train a model on some drives, for use on others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from roadeval import logs
from roadeval.config import ConfigError, RunConfig
from roadeval.data import Frame
from roadeval.jobs.outputs import AnyPath, holding
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.kernels import prepare
from roadeval.training import Model, TrainingError, TrainingSettings, learning, save_model
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
    ``auto`` and no drive has truth. Labels that are given hold for every drive that has none of
    its own (`RunConfig.drives`); where they do not occur, a 0/255 mask is understood by itself.

    Raises
    ------
    RoadevalError
        If some drives have truth and others none, or there is nothing to learn.
    """
    config = config or RunConfig()
    with holding(output, inputs=drives):
        model = _learnt(drives, config, on_progress)
        save_model(model, Path(output))
        return model


def _learnt(drives: Sequence[AnyPath], config: RunConfig, on_progress: OnProgress) -> Model:
    """Train on frames of all drives."""
    settings = config.training
    _require_a_drive_for_each(config, drives)
    if settings.seeds > 1:
        raise TrainingError(
            "`training.seeds`: a model file holds one training; set training.seed for another"
        )
    total = settings.frames * len(drives)
    held = HeldFrames()
    frames: dict[Path, list[Frame]] = {}
    readings: list[str] = []
    for drive in drives:
        own = config.for_drive(drive)
        several = len(drives) > 1 and own.labels == config.labels
        with logs.open_log(
            drive, keep_corrupt=own.frames.keep_corrupt, max_pixels=own.frames.max_pixels
        ) as log:
            selection = log.select(own.topics, own.labels, scale=own.frames.scale, several=several)
            readings += _understood(log, selection, own)
            there = partial(log.frames, selection, logs.Span.of(own.frames))
            prepare(lambda: on_progress(Progress(0, total, "compiling")))
            frames[log.path] = []
            for frame in _held(there, settings, held):
                frames[log.path].append(frame)
                on_progress(Progress(len(held.frames), total, "training"))
    return learning.from_drives(frames, config.pipelines(), settings, readings)


def _held(
    frames: Callable[[], logs.FrameStream], settings: TrainingSettings, held: HeldFrames
) -> Iterator[Frame]:
    """Decode the training frames of a drive and hold them; a `TrainingError` if they do not fit."""
    for frame in learning.spread(frames, settings.frames, labelled=settings.source != "patch"):
        if not held.add(frame):
            raise TrainingError(
                f"{held.full()}; lower `training.frames`, or reduce them with `frames.scale`"
            )
        yield frame


def _require_a_drive_for_each(config: RunConfig, drives: Sequence[AnyPath]) -> None:
    """Refuse settings of single drives that hold for none of these."""
    for each in config.drives:
        if not any(each.holds_for(drive) for drive in drives):
            names = ", ".join(map(str, drives))
            raise ConfigError(f"`drives` {each.path}: is none of the drives {names}")


def _understood(log: logs.Log, selection: logs.Selection, own: RunConfig) -> Iterator[str]:
    """Tell of a mask that was understood by itself although labels were given for all drives."""
    if selection.truth and own.labels.road and selection.truth.labels.by_itself:
        yield (
            f"{log.name}: none of the given labels occurs in {selection.truth.topic.name}, which "
            f"was read as {selection.truth.labels.words}"
        )
