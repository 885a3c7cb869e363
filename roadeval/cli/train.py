"""``roadeval train``: a model from some drives, for use on others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from roadeval.cli import console, messages, options, progress
from roadeval.cli.exit_codes import ExitCode


def train(
    drives: Annotated[
        list[Path], typer.Argument(metavar="DRIVE", help="Camera logs (MCAP), mostly with truth.")
    ],
    *,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="MODEL", help="Where the model lands.")
    ],
    preset: options.Preset = None,
    config: options.ConfigFile = None,
    variant: options.Variants = None,
    train_frames: options.TrainFrames = None,
    image_topic: options.ImageTopic = None,
    truth_topic: options.TruthTopic = None,
    road_label: options.RoadLabels = None,
    ignore_label: options.IgnoreLabels = None,
    road_color: options.RoadColors = None,
    ignore_color: options.IgnoreColors = None,
    sync_tolerance: options.SyncTolerance = None,
    resize_truth: options.ResizeTruth = False,
    scale: options.Scale = 1.0,
    keep_corrupt: options.KeepCorrupt = False,
    start: options.Start = None,
    end: options.End = None,
    quiet: options.Quiet = False,
) -> int:
    """Train a model on some drives, for use on others.

    The training frames are labelled ones, spread evenly over each drive. Where no drive has road
    truth, or training.source is "patch", the ground in front of the vehicle is taken for road.
    Replay never evaluates the training frames, on whatever drive it meets them.
    """
    from roadeval.cli import settings
    from roadeval.jobs.options import ReplayOptions
    from roadeval.jobs.train import train as run

    labels = settings.labels(road_label, ignore_label, road_color, ignore_color)
    chosen = ReplayOptions(
        config=settings.configuration(preset, config),
        variants=settings.variants(variant),
        image_topic=image_topic,
        truth_topic=truth_topic,
        road_labels=labels.road,
        ignore_labels=labels.ignore,
        road_colors=labels.road_colors,
        ignore_colors=labels.ignore_colors,
        start=start,
        end=end,
        sync_tolerance_ms=sync_tolerance,
        train_frames=train_frames,
        keep_corrupt=keep_corrupt,
        resize_truth=resize_truth,
        scale=scale,
    )
    with progress.watched(quiet) as watch:
        model = run(drives, output, options=chosen, on_progress=watch)
    for warning in model.warnings:
        messages.warning(warning)
    if not quiet:
        console.emit(
            f"{output}: {', '.join(model.parameters)}; trained on {len(model.digests)} frames, "
            f"{model.pixels} pixels, by the {model.source}"
        )
    return ExitCode.DONE
