"""``roadeval serve``: results as pages on this machine, with the viewer a click away."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from roadeval.cli import arguments, console, messages
from roadeval.cli.exit_codes import ExitCode


def serve(
    results: Annotated[
        list[Path],
        arguments.argument("RESULT...", "Recordings (.rrd), results folders, or fleets' folders."),
    ],
) -> int:
    """Serve results as pages to browse, on 127.0.0.1 alone.

    Every frame has its pictures, and a button that opens the viewer there. The address that is
    printed holds a token; without it nothing is answered. Ctrl-C ends the server and the viewer.
    """
    from roadeval.jobs.serve import serve as run

    run(results, _tell)
    return ExitCode.DONE


def _tell(address: str) -> None:
    console.emit(address)
    console.flush()
    messages.note("open that address in a browser; Ctrl-C ends")
