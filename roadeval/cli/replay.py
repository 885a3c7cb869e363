"""``roadeval replay``: the main job at the terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from roadeval.cli import console, messages, options, progress
from roadeval.cli.exit_codes import ExitCode


def replay(
    drive: options.Drive,
    save: Annotated[
        Path | None,
        options.output(
            "--save", metavar="OUT.rrd", help="Default: recordings/<drive>.rrd"
        ),
    ] = None,
    reports: Annotated[
        Path | None,
        options.output("--reports", metavar="DIR", help="Default: reports/<drive>/"),
    ] = None,
    record: options.Record = "all",
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
    sync_tolerance: options.SyncTolerance = None,
    start: options.Start = None,
    end: options.End = None,
    every: options.Every = 1,
    max_frames: options.MaxFrames = None,
    jobs: options.Jobs = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
) -> int:
    """Replay a log: record every step, score it against the truth, write tables and figures."""
    from roadeval.cli import settings, tables
    from roadeval.replay import ReplayOptions
    from roadeval.replay import replay as run

    chosen = ReplayOptions(
        config=settings.configuration(preset, config),
        variants=settings.variants(variant),
        model=model,
        image_topic=image_topic,
        truth_topic=truth_topic,
        shadow_topic=shadow_topic,
        road_labels=tuple(road_label or ()),
        ignore_labels=tuple(ignore_label or ()),
        start=start,
        end=end,
        every=every,
        max_frames=max_frames,
        sync_tolerance_ms=sync_tolerance,
        train_frames=train_frames,
        train_gap=train_gap,
        jobs=jobs,
        record=record,
    )
    with progress.watched(quiet) as watch:
        outcome = run(drive, save=save, reports=reports, options=chosen, on_progress=watch)
    for warning in outcome.warnings:
        messages.warning(warning)
    for loss in outcome.losses:
        messages.lost(loss)
    if json:
        console.emit_json(outcome.summary)
    elif not quiet:
        tables.print_outcome(outcome, console.results())
    return ExitCode.LOSS if outcome.losses else ExitCode.DONE
