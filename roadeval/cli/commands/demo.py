"""``roadeval demo``: the demo drive that ships."""

from __future__ import annotations

from pathlib import Path

from roadeval.cli import arguments, console
from roadeval.cli.exit_codes import ExitCode


def demo(
    output: arguments.NewLog = Path("recordings", "demo.mcap"), quiet: arguments.Quiet = False
) -> int:
    """Write the demo drive: a synthetic road with known truth.

        roadeval demo -o demo.mcap

    It has 100 frames of 640x480 pixels at 10 Hz, with truth of the road and of shadow.
    """
    from roadeval.jobs.log_files import demo as write

    log = write(output)
    if not quiet:
        console.emit(str(log))
    return ExitCode.DONE
