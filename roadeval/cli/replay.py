"""``roadeval replay``: the main job at the terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from roadeval.cli import console, messages, options, progress
from roadeval.cli.exit_codes import ExitCode


def replay(
    drive: options.Drive,
    *,
    save: Annotated[
        Path | None,
        options.option(
            "--save", metavar="OUT.rrd", help="Recording. Default: recordings/<drive>.rrd"
        ),
    ] = None,
    reports: Annotated[
        Path | None,
        options.option(
            "--reports", metavar="DIR", help="Tables and figures. Default: reports/<drive>/"
        ),
    ] = None,
    mcap: Annotated[
        Path | None,
        options.option(
            "--mcap", metavar="OUT.mcap", help="Masks and rates as a log, to open beside DRIVE."
        ),
    ] = None,
    preset: options.Preset = None,
    config: options.ConfigFile = None,
    variant: options.Variants = None,
    model: options.ModelFile = None,
    train_frames: options.TrainFrames = None,
    train_gap: options.TrainGap = None,
    image_topic: options.ImageTopic = None,
    truth_topic: options.TruthTopic = None,
    shadow_topic: options.ShadowTopic = None,
    road_label: options.RoadLabels = None,
    ignore_label: options.IgnoreLabels = None,
    road_color: options.RoadColors = None,
    ignore_color: options.IgnoreColors = None,
    mask_topic: options.MaskTopics = None,
    sync_tolerance: options.SyncTolerance = None,
    resize_truth: options.ResizeTruth = False,
    scale: options.Scale = 1.0,
    keep_corrupt: options.KeepCorrupt = False,
    start: options.Start = None,
    end: options.End = None,
    every: options.Every = 1,
    max_frames: options.MaxFrames = None,
    record: options.Record = "all",
    jobs: options.Jobs = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
) -> int:
    """Replay a log; record, score and plot every step.

    Every intermediate goes into a recording for the Rerun viewer. Where the log has truth, each
    stage is scored against it, with the shadow filter and without.
    """
    from roadeval.cli import outcome, settings
    from roadeval.jobs.options import ReplayOptions
    from roadeval.jobs.replay import replay as run
    from roadeval.results.summary import summary_text

    labels = settings.labels(road_label, ignore_label, road_color, ignore_color)
    chosen = ReplayOptions(
        config=settings.configuration(preset, config),
        variants=settings.variants(variant),
        model=model,
        image_topic=image_topic,
        truth_topic=truth_topic,
        shadow_topic=shadow_topic,
        mask_topics=settings.masks(mask_topic),
        road_labels=labels.road,
        ignore_labels=labels.ignore,
        road_colors=labels.road_colors,
        ignore_colors=labels.ignore_colors,
        start=start,
        end=end,
        every=every,
        max_frames=max_frames,
        sync_tolerance_ms=sync_tolerance,
        train_frames=train_frames,
        train_gap=train_gap,
        jobs=jobs,
        record=record,
        keep_corrupt=keep_corrupt,
        resize_truth=resize_truth,
        scale=scale,
    )
    with options.usage():
        chosen.check_sidecar(mcap)
    with progress.watched(quiet) as watch:
        found = run(drive, save=save, reports=reports, mcap=mcap, options=chosen, on_progress=watch)
    if json:
        console.emit(summary_text(found.summary).rstrip())
    elif not quiet:
        outcome.show(found, console.results())
    for warning in found.warnings:
        messages.warning(warning)
    for loss in found.losses:
        messages.lost(loss)
    return ExitCode.LOSS if found.losses else ExitCode.DONE
