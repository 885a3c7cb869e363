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
    from roadeval.logs import open_log
    from roadeval.options import ReplayOptions

    labels = settings.labels(road_label, ignore_label)
    chosen = ReplayOptions(
        image_topic=image_topic,
        truth_topic=truth_topic,
        shadow_topic=shadow_topic,
        road_labels=labels.road,
        ignore_labels=labels.ignore,
        sync_tolerance_ms=sync_tolerance,
        resize_truth=resize_truth,
    )
    with open_log(drive, keep_corrupt=keep_corrupt) as log:
        found = contents.describe(log, chosen)
    if json:
        console.emit(dumps(found, indent=2, ensure_ascii=False))
    else:
        contents.show(found, console.results())
    for damage in found["damage"]:
        messages.lost(damage)
    return ExitCode.LOSS if found["damage"] else ExitCode.DONE
