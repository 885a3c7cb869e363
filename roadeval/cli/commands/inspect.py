"""``roadeval inspect``: the worst frames, and the viewer opened at one."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from roadeval.cli import arguments, console, messages
from roadeval.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from roadeval.jobs.inspect import WorstFrame


def inspect(
    recording: arguments.Result,
    *,
    listed: Annotated[
        bool, typer.Option("--list", help="Print the worst frames with reasons.")
    ] = False,
    frame: Annotated[
        int | None, typer.Option("--frame", metavar="N", min=0, help="Open at frame N.")
    ] = None,
    worst: Annotated[
        int | None,
        typer.Option("--worst", metavar="K", min=1, help="Open at the K-th worst frame."),
    ] = None,
    variant: Annotated[
        str | None,
        typer.Option(
            "--variant", metavar="NAME", help="Whose failures count. Default: the first variant's."
        ),
    ] = None,
    screenshot: Annotated[
        Path | None,
        typer.Option(
            "--screenshot",
            metavar="FILE.png",
            help="No window: draw it into a file instead. Without a frame, the worst pictured.",
        ),
    ] = None,
    json: arguments.Json = False,
) -> int:
    """Open the viewer at a frame, or list the frames worth opening.

    The viewer works offline and listens on 127.0.0.1 alone. Of neighbouring frames only the worst
    is listed.
    """
    from roadeval.jobs import inspect as inspecting
    from roadeval.jobs.result import Result

    if frame is not None and worst is not None:
        raise typer.BadParameter("give --frame or --worst, not both")
    if listed and (frame is not None or screenshot is not None):
        raise typer.BadParameter("--list opens nothing; give it without --frame and --screenshot")
    opened = Result(recording)
    if listed:
        _list(inspecting.worst_frames(opened, worst or inspecting.LISTED, variant), as_json=json)
        return ExitCode.DONE
    chosen = ""
    if worst is not None:
        ranked = inspecting.worst_frames(opened, worst, variant)
        frame = ranked[-1].frame
    elif frame is None and screenshot is not None and (bad := inspecting.worst(opened, variant)):
        (first,) = inspecting.worst_frames(opened, 1, variant)
        which = "the worst" if bad.frame == first.frame else "the worst that has pictures"
        frame, chosen = bad.frame, f", {which} (--frame N or --worst K takes another)"
    if frame is not None and (said := inspecting.without_pictures(opened, frame)):
        messages.warning(said)
    shown = inspecting.view(opened, frame, screenshot)
    if screenshot is not None:
        console.emit(f"{screenshot}: frame {shown}{chosen}")
    return ExitCode.DONE


def _list(found: list[WorstFrame], *, as_json: bool) -> None:
    from roadeval.cli.screens import inspect as screen

    if as_json:
        from roadeval.results.summary import json_text, plain

        console.emit(json_text(plain([asdict(each) for each in found])).rstrip())
    else:
        screen.show(found, console.results())


COMMAND: Final = inspect
