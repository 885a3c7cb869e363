"""``roadeval info``: what is in a log, and what replay would pick of it and why."""

from __future__ import annotations

from json import dumps

from roadeval.cli import console, messages, options
from roadeval.cli.exit_codes import ExitCode


def info(
    drive: options.Drive,
    *,
    image_topic: options.ImageTopic = None,
    truth_topic: options.TruthTopic = None,
    shadow_topic: options.ShadowTopic = None,
    road_label: options.RoadLabels = None,
    ignore_label: options.IgnoreLabels = None,
    road_color: options.RoadColors = None,
    ignore_color: options.IgnoreColors = None,
    sync_tolerance: options.SyncTolerance = None,
    resize_truth: options.ResizeTruth = False,
    keep_corrupt: options.KeepCorrupt = False,
    json: options.Json = False,
) -> int:
    """Show what is in a log and what replay would pick.

    Topics with their kind, size, number and rate of messages, gaps and damage; and why replay
    would pick what it picks, or what it would ask for.
    """
    from roadeval.cli import contents, settings
    from roadeval.jobs.options import ReplayOptions
    from roadeval.logs import describe

    labels = settings.labels(road_label, ignore_label, road_color, ignore_color)
    chosen = ReplayOptions(
        image_topic=image_topic,
        truth_topic=truth_topic,
        shadow_topic=shadow_topic,
        road_labels=labels.road,
        ignore_labels=labels.ignore,
        road_colors=labels.road_colors,
        ignore_colors=labels.ignore_colors,
        sync_tolerance_ms=sync_tolerance,
        resize_truth=resize_truth,
    )
    found = describe(drive, chosen.topics(), chosen.labels(), keep_corrupt=keep_corrupt)
    if json:
        console.emit(dumps(found.as_dict(), indent=2, ensure_ascii=False))
    else:
        contents.show(found.as_dict(), console.results())
    for damage in found.damage:
        if damage not in found.losses:
            messages.warning(damage)
    for loss in found.losses:
        messages.lost(loss)
    return ExitCode.LOSS if found.losses else ExitCode.DONE
