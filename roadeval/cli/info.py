"""``roadeval info``: what is in a log, and what replay would pick of it and why."""

from __future__ import annotations

from roadeval.cli import console, messages, options
from roadeval.cli.exit_codes import ExitCode


def info(
    drive: options.Drive,
    image_topic: options.ImageTopic = None,
    truth_topic: options.TruthTopic = None,
    shadow_topic: options.ShadowTopic = None,
    road_label: options.RoadLabels = None,
    ignore_label: options.IgnoreLabels = None,
    sync_tolerance: options.SyncTolerance = None,
    json: options.Json = False,
) -> int:
    """Show a log's topics, frames, rates, gaps and damage; what replay would pick, and why."""
    from roadeval.cli import contents
    from roadeval.logs import open_log
    from roadeval.options import ReplayOptions

    chosen = ReplayOptions(
        image_topic=image_topic,
        truth_topic=truth_topic,
        shadow_topic=shadow_topic,
        road_labels=tuple(road_label or ()),
        ignore_labels=tuple(ignore_label or ()),
        sync_tolerance_ms=sync_tolerance,
    )
    with open_log(drive) as log:
        found = contents.describe(log, chosen)
    if json:
        console.emit_json(found)
    else:
        contents.show(found, console.results())
    for damage in found["damage"]:
        messages.lost(damage)
    return ExitCode.LOSS if found["damage"] else ExitCode.DONE
