"""``roadeval clip``: short films of what fails."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.arguments import option


def _span(text: str) -> range:
    match = re.fullmatch(r"(\d{1,9}):(\d{1,9})", text)
    if not match or not (frames := range(int(match[1]), int(match[2]) + 1)):
        raise ValueError(f"{text}: write the first and the last frame, as 40:80")
    return frames


def clip(
    result: arguments.Result,
    *,
    output: Annotated[
        Path, option("-o --output", "Folder, or the .mp4 or .gif of one clip.", "FOLDER|FILE")
    ] = Path("clips"),
    worst: Annotated[int | None, option("--worst", "Worst scenes. Default: 5.", "K", min=1)] = None,
    frames: Annotated[
        range | None, option("--frames", "One clip, of these frames.", "A:B", parser=_span)
    ] = None,
    focus: arguments.Focus = None,
    mcap: Annotated[bool, option("--mcap", "Log of the messages beside each clip.")] = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Film what fails, for people who do not have the data.

        roadeval clip recordings/drive.rrd
        roadeval clip recordings/drive.rrd --frames 40:80 -o turn.mp4 --mcap

    Each clip shows 2 s before and after the worst frame of a scene: the errors of the focus, and
    beside them the errors of the best other variant. The messages of --mcap begin 2 s earlier;
    'replay' reads them.
    """
    if worst and frames:
        raise typer.BadParameter("--worst and --frames do not go together")
    from roadeval.jobs.results.clip import clip as run

    with progress.show(quiet) as watch:
        films, losses = run(
            *(result, output), worst=worst, frames=frames, focus=focus, mcap=mcap, on_progress=watch
        )
    for film in films if not quiet else ():
        console.emit(f"{film}, {film.with_suffix('.mcap')}" if mcap else str(film))
    return messages.losses(losses)
