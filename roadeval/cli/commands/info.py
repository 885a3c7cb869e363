"""``roadeval info``: the content of a log, and what replay would use of it and why."""

from __future__ import annotations

from typing import Annotated

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.options import OptionValues, takes


@takes(
    *("truth", "topics", "cameras", "ground", "labels", "frames.max_pixels"),
    *("frames.white", "frames.unturned", "frames.full_range"),
)
def info(
    drive: arguments.Drive,
    *,
    options: OptionValues,
    verify: Annotated[
        bool, arguments.option("--verify", "Search of the whole log for damage.")
    ] = False,
    json: arguments.Json = False,
) -> int:
    """Show what is in a log and what replay would pick.

        roadeval info drive.mcap

    It shows each topic's kind, size, number and rate of messages, and gaps; damage; and what replay
    would pick and why, or what it would ask for. Without --verify, only the indexes of a log of
    more than 50 MB are read, and only the summary and first messages of a log behind a URL.
    """
    arguments.check_one_camera(options)
    config = arguments.configuration(options)
    from roadeval.cli.screens import info as screen
    from roadeval.jobs.log_files import info as describe

    with progress.show(quiet=json or not verify) as watch:
        log = describe(drive, config, verify=verify, on_progress=watch)
    if json:
        from roadeval.results.facts import json_text

        console.emit(json_text(log.as_dict()).rstrip())
    else:
        screen.show(log, console.results())
    messages.warning(*(damage for damage in log.damage if damage not in log.losses))
    return messages.losses(log.losses)
