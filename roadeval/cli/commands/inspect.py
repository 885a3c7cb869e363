"""``roadeval inspect``: the worst frames, and the viewer opened at one."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadeval.cli import arguments, console, messages
from roadeval.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from roadeval.jobs.results.result import Result

Results = Annotated[
    Path, arguments.argument("RESULT", "A recording (.rrd), a results folder, or a fleet's folder.")
]
Listed = Annotated[bool, arguments.option("--list", "Print the worst frames with reasons.")]
Frame = Annotated[int | None, arguments.option("--frame", "Open at frame N.", "N", min=0)]
Rank = Annotated[
    int | None, arguments.option("--worst", "Open at the K-th worst frame.", "K", min=1)
]
Variant = Annotated[
    str | None,
    arguments.option(
        "--variant",
        "Variant whose failures count; by default what you brought, else `filtered`.",
        "NAME",
    ),
]
Screenshot = Annotated[
    Path | None,
    arguments.option(
        "--screenshot",
        "No window: draw it into a file instead. Without a frame, the worst pictured.",
        "FILE.png",
    ),
]


def inspect(
    recording: Results,
    *,
    listed: Listed = False,
    frame: Frame = None,
    worst: Rank = None,
    variant: Variant = None,
    camera: arguments.Camera = None,
    screenshot: Screenshot = None,
    json: arguments.Json = False,
) -> int:
    """Open the viewer at a frame, or list the frames worth opening.

    The viewer works offline and listens on 127.0.0.1 alone. Of neighbouring frames only the worst
    is listed. Of a fleet the frames of all drives are ranked together, and the worst of all opens
    by default.
    """
    if frame is not None and worst is not None:
        raise typer.BadParameter("give --frame or --worst, not both")
    if listed and (frame is not None or screenshot is not None):
        raise typer.BadParameter("--list opens nothing; give it without --frame and --screenshot")
    from roadeval.jobs.results.result import Result

    opened = arguments.of_camera(Result(recording), camera)
    if opened.fleet and variant is not None:
        raise typer.BadParameter("--variant does not go with a fleet: its worst are the first's")
    if opened.fleet and frame is not None:
        raise typer.BadParameter("--frame does not go with a fleet: give its drive's recording")
    if listed:
        _list(opened, worst, variant, as_json=json)
    else:
        _show(opened, frame, worst, variant, file=screenshot)
    for warning in opened.warnings:
        messages.warning(warning)
    return ExitCode.DONE


def _list(opened: Result, count: int | None, variant: str | None, *, as_json: bool) -> None:
    """Print the worst frames, for people or as JSON."""
    from roadeval.cli.screens import inspect as screen
    from roadeval.jobs.results import inspect as job
    from roadeval.results.facts import json_text, plain

    found = job.worst_frames(opened, count or job.LISTED, variant)
    if as_json:
        console.emit(json_text(plain([asdict(each) for each in found])).rstrip())
    else:
        screen.show(opened.name, found, console.results(), of_fleet=opened.fleet is not None)


def _show(
    opened: Result, frame: int | None, rank: int | None, variant: str | None, *, file: Path | None
) -> None:
    """Open the viewer at a frame, by its number or rank, or draw it into a file."""
    from roadeval.evaluation.metrics import TESTED
    from roadeval.jobs.results import inspect as job

    drive, of, why = opened.drive, "", ""
    if rank is not None or drive is None:
        found = job.of_rank(opened, rank or 1, variant)
        drive, of = job.drive_of(opened, found)
        frame = found.frame if frame is None else frame
    elif file and frame is None and (bad := job.worst(drive, variant)):
        which = "worst" if bad.by == TESTED else "first to look at"
        why = f", the {which} with pictures (--frame N or --worst K takes another)"
        frame = bad.frame
    if frame is not None and (sentence := job.without_pictures(drive, frame)):
        messages.warning(sentence)
    shown = job.view(drive, frame, file)
    if file:
        console.emit(f"{file}: {of}frame {shown}{why}")
