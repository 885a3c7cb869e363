"""Train a model on some drives, for use on others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from roadeval import logs
from roadeval.config import ConfigError, RunConfig
from roadeval.data import Frame
from roadeval.jobs.outputs import holding
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.runtime.files import AnyPath, Paths, listed
from roadeval.training import Model, TrainingError, learning, save_model
from roadeval.training.learning import HeldFrames


def train(
    drives: Paths,
    output: AnyPath,
    config: RunConfig | None = None,
    *,
    on_progress: OnProgress = ignore,
) -> Model:
    """Train every variant on one drive or some, and write the model file.

    From each drive ``training.frames`` labelled frames are taken, spread evenly over the selected
    range. Frames without truth are taken where ``training.source`` is ``patch``, or ``auto`` and no
    drive has truth. The labels hold for every drive without its own (`RunConfig.drives`). Frames
    that cannot be decoded are left out, and listed in `Model.losses`. A `RoadevalError` if some
    drives have truth and others none, or there is nothing to learn.
    """
    config, paths = (config or RunConfig()).resolved(), listed(drives)
    settings = config.training
    for path in config.unused(paths):
        names = ", ".join(map(str, paths))
        raise ConfigError(f"`drives` {path}: is none of the drives {names}")
    if settings.seeds > 1:
        raise TrainingError(
            "`training.seeds`: a model file holds one training; set training.seed for another"
        )
    held, total = HeldFrames(), settings.frames * len(paths)

    def show() -> None:
        on_progress(Progress(len(held.frames), total, "training"))

    with holding(output, inputs=paths):
        drawn = [_draw(path, config, held, show) for path in paths]
        frames = {each.path: each.frames for each in drawn}
        model = learning.from_drives(frames, config.pipelines(), settings)
        losses = [
            sentence if len(drawn) == 1 or sentence.startswith(start) else f"{start}{sentence}"
            for each in drawn
            for start in [f"{each.path.name}: "]
            for sentence in each.losses
        ]
        model = replace(model, losses=tuple(losses))
        save_model(model, Path(output))
        return model


@dataclass(frozen=True, slots=True)
class _Drawn:
    """The training frames of a drive."""

    path: Path
    frames: Sequence[Frame]
    losses: Sequence[str]
    """What of the drive could not be read."""


def _draw(drive: AnyPath, config: RunConfig, held: HeldFrames, show: Callable[[], None]) -> _Drawn:
    """Decode the training frames of a drive and hold them."""
    own, frames, streams = config.for_drive(drive), list[Frame](), list[logs.FrameStream]()
    with logs.open_log(drive, own.for_training()) as log:
        selection = log.select()

        def begin() -> logs.FrameStream:
            streams.append(log.frames(selection))
            return streams[-1]

        labelled = own.training.source != "patch"
        for frame in learning.spread(begin, own.training.frames, labelled=labelled):
            held.add(frame)
            frames.append(frame)
            show()
        account = streams[-1].accounting
        losses = [*log.losses, *account.losses]
        if missing := len(account.undecodable):
            total = missing + len(frames)
            losses.append(f"{missing} of {total} training frames could not be decoded")
        if losses and not frames:
            raise TrainingError(f"{log.path.name}: no training frame could be decoded: {losses[0]}")
        return _Drawn(log.path, frames, losses)
