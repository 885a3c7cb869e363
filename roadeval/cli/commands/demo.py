"""``roadeval demo``: the synthetic drive with known truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from roadeval.cli import arguments, console, progress
from roadeval.cli.exit_codes import ExitCode

DEFAULT: Final = Path("recordings", "demo.mcap")


def demo(
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DRIVE.mcap", help="Where the log lands.", readable=False
        ),
    ] = DEFAULT,
    seed: Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Another drive.")] = 0,
    quiet: arguments.Quiet = False,
) -> int:
    """Render the synthetic drive with known truth.

    100 frames, 640x480, 10 Hz; truth of the road and of shadow. The same seed gives the same
    drive.
    """
    from roadeval.jobs.demo import demo as render
    from roadeval.synth import RenderSettings

    with progress.watched(quiet) as watch:
        log = render(output, RenderSettings(seed=seed), on_progress=watch)
    if not quiet:
        console.emit(str(log))
    return ExitCode.DONE


COMMAND: Final = demo
