"""``roadeval clip``: short films of what fails."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.arguments import option
from roadeval.cli.commands.inspect import Results


def _frames(text: str) -> range:
    first, last = map(int, text.split(":"))
    return range(first, last + 1)


def clip(
    result: Results,
    *,
    output: Annotated[
        Path, option("-o --output", "Folder, or the .mp4 or .gif of one clip.", "FOLDER|FILE")
    ] = Path("clips"),
    worst: Annotated[
        int | None, option("--worst", "Worst scenes. Default: 5, or 1 into a file.", "K", min=1)
    ] = None,
    frames: Annotated[
        range | None, option("--frames", "One clip, of frames A to B.", "A:B", parser=_frames)
    ] = None,
    focus: arguments.Focus = None,
    mcap: Annotated[bool, option("--mcap", "Also the log's own messages, as a log.")] = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Film what fails, for people who do not have the data.

        roadeval clip recordings/drive.rrd
        roadeval clip recordings/drive.rrd --frames 40:80 -o turn.mp4 --mcap

    Each shows 2 s before and after the worst frame of a scene: the errors of the focus, and beside
    them those of the best other variant. The messages begin 2 s earlier, and 'replay' opens them.
    """
    if worst and frames:
        raise typer.BadParameter("give --worst or --frames, not both")
    from roadeval.jobs.results.clip import clip as run

    with progress.show(quiet) as watch:
        films, losses = run(
            *(result, output), worst=worst, frames=frames, focus=focus, mcap=mcap, on_progress=watch
        )
    for film in films if not quiet else ():
        console.emit(f"{film}, {film.with_suffix('.mcap')}" if mcap else str(film))
    return messages.losses(losses)
