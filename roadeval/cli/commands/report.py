"""``roadeval report``: the report of a drive or of a fleet as a PDF."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from roadeval.cli import arguments, console, messages
from roadeval.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from roadeval.jobs.result import Result
    from roadeval.report.findings import Commands


def report(
    result: arguments.Result,
    *,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE.pdf",
            help="Default: reports/<recording>.pdf, or report.pdf in the folder given.",
        ),
    ] = None,
    paper: arguments.PaperSize = "a4",
    quiet: arguments.Quiet = False,
) -> int:
    """Write the report of a drive, or of a fleet, as a PDF.

    Does the filter help, where are the errors, which stage broke it, and the frames to look at;
    from the recording alone, or from a results folder, then without pictures.
    """
    from roadeval.jobs.report import write_report
    from roadeval.jobs.result import Result
    from roadeval.results.fleet.folder import is_fleet

    size = arguments.paper_of(paper)
    warnings: Sequence[str] = ()
    if is_fleet(result):
        path = write_report(result, output, paper=size)
    else:
        read = Result(result)
        path = write_report(read, output, paper=size, commands=_commands(read))
        warnings = read.warnings
    if not quiet:
        console.emit(str(path))
    for warning in warnings:
        messages.warning(warning)
    return ExitCode.DONE


def _commands(result: Result) -> Commands:
    from roadeval.report.findings import Commands

    path, config = str(result.path), result.configuration
    return Commands(
        again=None
        if config is None
        else lambda log: shlex.join(["roadeval", "replay", log, "--config", str(config)]),
        inspect=lambda frame: shlex.join(["roadeval", "inspect", path, "--frame", str(frame)]),
    )


COMMAND: Final = report
