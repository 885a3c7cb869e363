"""``roadeval train``: a model from some drives, for use on others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.options import OptionValues, takes


@takes(
    *("preset", "config", "variants", "nets", "masks", "tunes", "training.frames"),
    *("truth", "cameras", "topics.truth", "topics.masks", "labels"),
    *("topics.sync_tolerance_ms", "topics.sync_offset_ms"),
    *("topics.resize_truth", "topics.frame_id"),
    *("frames.scale", "frames.max_pixels"),
    *("frames.white", "frames.unturned", "frames.full_range"),
    *("frames.start", "frames.end", "run.patience_s"),
)
def train(
    paths: Annotated[
        list[str],
        arguments.argument(
            "DRIVE...",
            "Camera logs (MCAP), folders, URLs, or manifests (.toml); logs usually have truth.",
        ),
    ],
    *,
    output: Annotated[Path, arguments.option("-o --output", "File of the model.", "MODEL")],
    options: OptionValues,
    quiet: arguments.Quiet = False,
) -> int:
    """Train a model on some drives, for use on others.

        roadeval train monday.mcap tuesday.mcap -o city.model

    The training frames are labelled frames, spread evenly over each drive. If no drive has road
    truth, or training.source is "patch", the ground in front of the vehicle is taken for road.
    Replay never evaluates the training frames, on any drive.
    """
    arguments.check_one_camera(options)
    config = arguments.configuration(options)
    from roadeval.jobs.run.train import train as run

    with progress.show(quiet) as watch:
        model = run(paths, output, config, on_progress=watch)
    messages.warn_of_missing_loops()
    messages.warning(*model.warnings)
    if not quiet:
        console.say(
            f"{output}: {', '.join(model.parameters)}; trained on {len(model.digests)} frames, "
            f"{model.pixels} pixels, by the {model.source}"
        )
    return messages.losses(model.losses)
