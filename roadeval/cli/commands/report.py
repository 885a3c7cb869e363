"""``roadeval report``: the report of a drive or of a fleet, as a PDF or as a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.exit_codes import ExitCode


def _ending(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() not in (".pdf", ".html", ".htm", ""):
        raise typer.BadParameter(f"{path}: end it in .pdf or .html")
    return path


def report(
    result: arguments.Result,
    *,
    output: Annotated[
        Path | None,
        arguments.option(
            "-o --output",
            "A page to browse where it ends in .html. Default: reports/<recording>.pdf, or "
            "report.pdf in the folder given.",
            "FILE.pdf|FILE.html",
            callback=_ending,
        ),
    ] = None,
    paper: arguments.PaperSize = "a4",
    pictures: Annotated[
        int | None,
        arguments.option(
            "--pictures",
            "Of a page: frames with pictures. Default: as many as keep it below 10 MB.",
            "N",
            min=0,
        ),
    ] = None,
    camera: arguments.Camera = None,
    quiet: arguments.Quiet = False,
) -> int:
    """Write the report of a drive or of a fleet, as a PDF or as a page.

    Does the filter help, where are the errors, which stage broke it, and the frames to look at;
    from the recording alone, or from a results folder, then without pictures. A page is one file
    that needs no network and no server; of a fleet its pictures lie in a folder beside it.
    """
    from roadeval.jobs.results.report import is_page, write_report
    from roadeval.jobs.results.result import Result

    size = arguments.paper_of(paper)
    if pictures is not None and not (output and is_page(output)):
        raise typer.BadParameter("--pictures goes with a page alone: -o FILE.html")
    opened = arguments.of_camera(Result(result), camera)
    with progress.watched(quiet) as watch:
        path = write_report(opened, output, paper=size, pictures=pictures, on_progress=watch)
    if not quiet:
        console.emit(str(path))
    for warning in opened.warnings:
        messages.warning(warning)
    return ExitCode.DONE


COMMAND: Final = report
