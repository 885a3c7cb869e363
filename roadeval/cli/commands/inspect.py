"""``roadeval inspect``: a list of the worst frames, or the viewer opened at one."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadeval.cli import arguments, console, messages
from roadeval.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from roadeval.jobs.results.result import Result

Listed = Annotated[bool, arguments.option("--list", "List of the worst frames, with reasons.")]
Frame = Annotated[int | None, arguments.option("--frame", "Frame to open.", "N", min=0)]
Rank = Annotated[
    int | None,
    arguments.option("--worst", "Rank of the frame to open; with --list: how many.", "K", min=1),
]
Focus = Annotated[
    str | None,
    arguments.option(
        "--variant --focus",
        "Variant that ranks the frames by its errors. Default: what you brought, else filtered.",
        "NAME",
    ),
]
Screenshot = Annotated[
    Path | None,
    arguments.option(
        "-o --output --screenshot",
        "File for a picture of the frame; no window opens. Default: the worst frame with pictures.",
        "FILE.png",
    ),
]


def inspect(
    recording: arguments.Result,
    *,
    listed: Listed = False,
    frame: Frame = None,
    worst: Rank = None,
    focus: Focus = None,
    camera: arguments.Camera = None,
    screenshot: Screenshot = None,
    json: arguments.Json = False,
) -> int:
    """Open the viewer at a frame, or list the frames worth opening.

        roadeval inspect recordings/drive.rrd --list
        roadeval inspect recordings/drive.rrd --worst 1 --screenshot worst.png

    The viewer works offline and listens on 127.0.0.1 alone. The list has only the worst
    frame of each scene. The frames of all drives of a fleet are ranked together, and the worst
    one opens by default.
    """
    if frame is not None and worst is not None:
        raise typer.BadParameter("give --frame or --worst, not both")
    if listed and (frame is not None or screenshot is not None):
        raise typer.BadParameter("--list opens nothing; give it without --frame and --screenshot")
    from roadeval.cli.screens import inspect as screen
    from roadeval.jobs.results import inspect as job
    from roadeval.jobs.results.result import Result
    from roadeval.results.facts import json_text, plain

    opened = arguments.select_camera(Result(recording, focus=focus), camera)
    if opened.fleet and frame is not None:
        raise typer.BadParameter("--frame does not go with a fleet: give one drive's recording")
    if not listed:
        _show(opened, frame, worst, file=screenshot)
    else:
        frames = job.worst_frames(opened, worst or job.LISTED)
        if json:
            console.emit(json_text(plain([asdict(frame) for frame in frames])).rstrip())
        else:
            screen.show(opened.name, frames, console.results(), of_fleet=opened.fleet is not None)
    messages.warning(*opened.warnings)
    return ExitCode.DONE


def _show(opened: Result, frame: int | None, rank: int | None, *, file: Path | None) -> None:
    """Open the viewer at a frame, by its number or rank, or write its picture to ``file``."""
    from roadeval.evaluation.metrics import TESTED
    from roadeval.jobs.results import inspect as job

    drive, place, why = opened.drive, "", ""
    if rank is not None or drive is None:
        ranked = job.of_rank(opened, rank or 1)
        drive, place = job.drive_of(opened, ranked)
        frame = ranked.frame if frame is None else frame
    elif file and frame is None and (worst := job.worst(drive)):
        which = "worst" if worst.by == TESTED else "first to look at"
        why = f", the {which} with pictures (--frame N or --worst K takes another)"
        frame = worst.frame
    if frame is not None and (sentence := job.without_pictures(drive, frame)):
        messages.warning(sentence)
    shown = job.view(drive, frame, file)
    if file:
        console.say(f"{file}: {place}frame {shown}{why}")
