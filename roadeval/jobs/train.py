"""Train a model on some drives, for use on others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from roadeval import logs
from roadeval.config import ConfigError, RunConfig
from roadeval.data import Frame
from roadeval.jobs.outputs import holding
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.runtime.paths import AnyPath, Paths, listed
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

    From each drive ``training.frames`` labelled frames are taken, spread evenly over the
    selected range. Frames without truth are taken where ``training.source`` is ``patch``, or
    ``auto`` and no drive has truth. Labels that are given hold for every drive that has none of
    its own (`RunConfig.drives`); where they do not occur, a 0/255 mask is understood by itself.
    Frames that cannot be decoded are left out, and `Model.losses` tells of them.

    Raises
    ------
    RoadevalError
        If some drives have truth and others none, or there is nothing to learn.
    """
    config, paths = config or RunConfig(), listed(drives)
    with holding(output, inputs=paths):
        model = _learnt(paths, config, on_progress)
        save_model(model, Path(output))
        return model


@dataclass(frozen=True, slots=True)
class _Drawn:
    """The training frames of a drive, what to know of them, and what of the drive was lost."""

    frames: Sequence[Frame]
    told: tuple[str, ...]
    losses: tuple[str, ...]


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

    def show() -> None:
        on_progress(Progress(len(held.frames), total, "training"))

    drawn: dict[Path, _Drawn] = {}
    for drive in drives:
        own = config.for_drive(drive)
        several = len(drives) > 1 and own.labels == config.labels
        with logs.open_log(drive, replace(own, masks={})) as log:
            selection = log.select(several=several)
            drawn[log.path] = _draw(log, selection, own, held, show)
    frames = {path: each.frames for path, each in drawn.items()}
    told = [sentence for each in drawn.values() for sentence in each.told]
    model = learning.from_drives(frames, config.pipelines(), settings, told)
    return replace(model, losses=tuple(_lost(drawn)))


def _draw(
    log: logs.Log,
    selection: logs.Selection,
    own: RunConfig,
    held: HeldFrames,
    show: Callable[[], None],
) -> _Drawn:
    """Decode the training frames of a drive and hold them."""
    settings = own.training
    frames: list[Frame] = []
    streams: list[logs.FrameStream] = []

    def begin() -> logs.FrameStream:
        streams.append(log.frames(selection))
        return streams[-1]

    labelled = settings.source != "patch"
    for frame in learning.spread(begin, settings.frames, labelled=labelled):
        if not held.add(frame):
            raise TrainingError(
                f"{held.full()}; lower `training.frames`, or reduce them with `frames.scale`"
            )
        frames.append(frame)
        show()
    losses = (*log.losses, *_left_out(streams[-1], frames))
    if losses and not frames:
        raise TrainingError(f"{log.path.name}: no training frame could be decoded: {losses[0]}")
    told = (*_understood(selection, own), *streams[-1].oddities)
    return _Drawn(frames, tuple(f"{log.name}: {each}" for each in told), losses)


def _left_out(stream: logs.FrameStream, frames: Sequence[Frame]) -> Iterator[str]:
    """Name and count the training frames that are damaged."""
    yield from stream.accounting.losses
    if missing := len(stream.accounting.undecodable):
        yield f"{missing} of {missing + len(frames)} training frames could not be decoded"


def _lost(drawn: Mapping[Path, _Drawn]) -> Iterator[str]:
    """Yield what was lost; of several drives, with the drive's name before it."""
    for path, each in drawn.items():
        for sentence in each.losses:
            names_it = len(drawn) == 1 or sentence.startswith(f"{path.name}: ")
            yield sentence if names_it else f"{path.name}: {sentence}"


def _require_a_drive_for_each(config: RunConfig, drives: Sequence[AnyPath]) -> None:
    """Refuse settings of single drives that hold for none of these."""
    for path in config.unused(drives):
        names = ", ".join(map(str, drives))
        raise ConfigError(f"`drives` {path}: is none of the drives {names}")


def _understood(selection: logs.Selection, own: RunConfig) -> Iterator[str]:
    """Return a warning for a mask that was understood by itself although labels were given."""
    if selection.truth and own.labels.road and selection.truth.meaning.by_itself:
        yield (
            f"none of the given labels occurs in {selection.truth.where}, which "
            f"was read as {selection.truth.meaning.words}"
        )
