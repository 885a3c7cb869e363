"""Train a model on some drives, for use on others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from roadeval.config.run import RunConfig
from roadeval.data import Frame
from roadeval.fleet.drives import DriveEntry, find_drives
from roadeval.fleet.remote import open_source
from roadeval.jobs.outputs import holding
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.logs.frames import FrameStream
from roadeval.logs.log import open_log
from roadeval.runtime.files import AnyPath, Paths
from roadeval.training import learning
from roadeval.training.learning import HeldFrames, TrainingError
from roadeval.training.model import Model, save_model


def train(
    drives: Paths,
    output: AnyPath,
    config: RunConfig | None = None,
    *,
    on_progress: OnProgress = ignore,
) -> Model:
    """Train every variant on one or more drives, and write the model file.

    ``drives`` are named as for `roadeval.replay_fleet`. From each drive ``training.frames``
    labelled frames are used, spread evenly over the selected range. Frames without truth are used
    if ``training.source`` is ``patch``, or if it is ``auto`` and no drive has truth. The settings
    of labels hold for every drive without own ones in a manifest. Frames that cannot be decoded are
    left out, and listed in `Model.losses`. A `RoadevalError` if only some drives have truth, or
    there is nothing to learn.
    """
    config = (config or RunConfig()).resolved()
    settings, entries = config.training, find_drives(drives)
    total = settings.frames * len(entries)
    held = HeldFrames(lambda count: on_progress(Progress(count, total, "training")))
    with holding(output, inputs=[entry.path for entry in entries]):
        frames, losses = dict[Path, list[Frame]](), list[str]()
        for entry in entries:
            path = Path(f"{entry.shown} {entry.camera}".rstrip())
            name = path.name if len(entries) > 1 else ""
            frames[path], lost = training_frames(entry, entry.config(config), held, name=name)
            losses += lost
        model = learning.from_drives(frames, config.pipelines(), settings)
        model = replace(model, losses=tuple(losses))
        save_model(model, Path(output))
        return model


def training_frames(
    drive: DriveEntry,
    config: RunConfig,
    held: HeldFrames,
    *,
    labelled: bool = False,
    name: str = "",
) -> tuple[list[Frame], list[str]]:
    """Return the training frames of a drive, added to the ``held`` ones, and sentences on losses.

    If they must be ``labelled``, a drive without road truth gives none. The sentences begin with
    the ``name``, if there is one.
    """
    frames, streams = list[Frame](), list[FrameStream]()
    with open_log(open_source(drive.source, config.run.patience_s), config.for_training()) as log:
        selection = log.select()
        if labelled and selection.truth is None:
            return [], []

        def begin() -> FrameStream:
            streams.append(log.frames(selection))
            return streams[-1]

        by_truth = labelled or config.training.source != "patch"
        for frame in learning.decode_evenly(begin, config.training.frames, labelled=by_truth):
            if labelled and frame.truth is None:
                return [], []
            held.add(frame)
            frames.append(frame)
        account = streams[-1].accounting
        losses = [*log.losses, *account.losses]
        if missing := len(account.undecodable):
            total = missing + len(frames)
            losses.append(f"{missing} of {total} training frames could not be decoded")
        if losses and not frames:
            raise TrainingError(
                f"no training frame could be decoded: {losses[0]}", where=log.path.name
            )
        named = {str(damage) for damage in log.damage if damage.path.name == name}
        return frames, [loss if loss in named or not name else f"{name}: {loss}" for loss in losses]
