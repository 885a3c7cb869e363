"""``roadeval info``: what is in a log, and what replay would pick of it and why."""

from __future__ import annotations

from typing import Annotated

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.options import Given, takes


@takes(
    *("truth", "topics", "cameras", "ground", "labels", "frames.max_pixels"),
    *("frames.white", "frames.unturned", "frames.full_range"),
)
def info(
    drive: arguments.Drive,
    *,
    given: Given,
    verify: Annotated[
        bool, arguments.option("--verify", "Read the whole log, so that all damage is found.")
    ] = False,
    json: arguments.Json = False,
) -> int:
    """Show what is in a log and what replay would pick.

    Topics with their kind, size, number and rate of messages, gaps and damage; and why replay
    would pick what it picks, or what it would ask for. Of a log of more than 50 MB only the
    indexes are read, unless --verify asks for all of it.
    """
    arguments.check_one_camera(given)
    config = arguments.configuration(given)
    from roadeval.cli.screens import info as screen
    from roadeval.jobs.log_files import info as describe

    with progress.watched(quiet=json or not verify) as watch:
        found = describe(drive, config, verify=verify, on_progress=watch)
    if json:
        from roadeval.results.facts import json_text

        console.emit(json_text(found.as_dict()).rstrip())
    else:
        screen.show(found.as_dict(), console.results())
    for damage in found.damage:
        if damage not in found.losses:
            messages.warning(damage)
    return messages.losses(found.losses)
