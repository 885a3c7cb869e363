"""``roadeval inspect``: the worst frames, and the viewer opened at one."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from roadeval.cli import arguments, console, fleet_inspect, messages
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.fleet_inspect import Asked

if TYPE_CHECKING:
    from roadeval.jobs.result import DriveResult

Listed = Annotated[bool, typer.Option("--list", help="Print the worst frames with reasons.")]
Frame = Annotated[int | None, typer.Option("--frame", metavar="N", min=0, help="Open at frame N.")]
Rank = Annotated[
    int | None, typer.Option("--worst", metavar="K", min=1, help="Open at the K-th worst frame.")
]
Variant = Annotated[
    str | None,
    typer.Option(
        "--variant", metavar="NAME", help="Whose failures count. Default: the first variant's."
    ),
]
Drive = Annotated[
    str | None,
    typer.Option("--drive", metavar="ID", help="Of a fleet: open this drive, at --frame."),
]
Screenshot = Annotated[
    Path | None,
    typer.Option(
        "--screenshot",
        metavar="FILE.png",
        help="No window: draw it into a file instead. Without a frame, the worst pictured.",
        readable=False,
    ),
]


def inspect(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="RESULT",
            show_default=False,
            help="A recording (.rrd), a results folder, or a fleet's folder.",
            readable=False,
        ),
    ],
    *,
    listed: Listed = False,
    frame: Frame = None,
    worst: Rank = None,
    variant: Variant = None,
    drive: Drive = None,
    screenshot: Screenshot = None,
    trust_sources: arguments.TrustSources = False,
    json: arguments.Json = False,
) -> int:
    """Open the viewer at a frame, or list the frames worth opening.

    The viewer works offline and listens on 127.0.0.1 alone. Of neighbouring frames only the worst
    is listed. Of a fleet the frames of all drives are ranked together, and the worst of all opens
    by default; a drive that was not kept is replayed from its log, if --trust-sources allows it.
    """
    if frame is not None and worst is not None:
        raise typer.BadParameter("give --frame or --worst, not both")
    if listed and (frame is not None or screenshot is not None):
        raise typer.BadParameter("--list opens nothing; give it without --frame and --screenshot")
    from roadeval.results.fleet.kind import is_fleet

    if is_fleet(recording):
        from roadeval.results.fleet.folder import Fleet

        if variant is not None:
            raise typer.BadParameter(
                "--variant does not go with a fleet: its worst are the first's"
            )
        asked = Asked(listed, drive, frame, worst, screenshot, json)
        return fleet_inspect.inspect(Fleet(recording, trust_sources=trust_sources), asked)
    if drive is not None:
        raise typer.BadParameter("--drive goes with a fleet's folder alone")
    if trust_sources:
        raise typer.BadParameter("--trust-sources goes with a fleet's folder alone")
    from roadeval.jobs.result import DriveResult

    opened = DriveResult(recording)
    if listed:
        _list(opened, worst, variant, as_json=json)
    elif screenshot is not None:
        _draw(opened, _asked_for(opened, frame, worst, variant), variant, screenshot)
    else:
        _open(opened, _asked_for(opened, frame, worst, variant))
    for warning in opened.warnings:
        messages.warning(warning)
    return ExitCode.DONE


def _list(opened: DriveResult, count: int | None, variant: str | None, *, as_json: bool) -> None:
    """Print the worst frames, for people or as JSON."""
    from roadeval.cli.screens import inspect as screen
    from roadeval.jobs import inspect as inspecting
    from roadeval.results.summary import json_text, plain

    found = inspecting.worst_frames(opened, count or inspecting.LISTED, variant)
    if as_json:
        console.emit(json_text(plain([asdict(each) for each in found])).rstrip())
    else:
        screen.show(opened.name, found, console.results())


def _asked_for(
    opened: DriveResult, frame: int | None, worst: int | None, variant: str | None
) -> int | None:
    """Return the number of the frame that was asked for, by itself or by its rank."""
    from roadeval.jobs.inspect import worst_frames

    return frame if worst is None else worst_frames(opened, worst, variant)[-1].frame


def _draw(opened: DriveResult, frame: int | None, variant: str | None, file: Path) -> None:
    """Draw a frame into a file, the worst that has pictures if none was asked for."""
    from roadeval.jobs import inspect as inspecting

    why = ""
    if frame is None and (bad := inspecting.worst(opened, variant)):
        (first,) = inspecting.worst_frames(opened, 1, variant)
        which = "the worst" if bad.frame == first.frame else "the worst that has pictures"
        frame, why = bad.frame, f", {which} (--frame N or --worst K takes another)"
    console.emit(f"{file}: frame {_open(opened, frame, file)}{why}")


def _open(opened: DriveResult, frame: int | None, file: Path | None = None) -> int | None:
    """Open the viewer at a frame, or draw it into a file; return the frame that it shows."""
    from roadeval.jobs import inspect as inspecting

    if frame is not None and (said := inspecting.without_pictures(opened, frame)):
        messages.warning(said)
    return inspecting.view(opened, frame, file)


COMMAND: Final = inspect
