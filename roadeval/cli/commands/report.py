"""``roadeval report``: the report of a drive or of a fleet, as a PDF or as a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.exit_codes import ExitCode


def report(
    result: arguments.Result,
    *,
    output: Annotated[
        Path | None,
        arguments.option(
            "-o --output",
            "File of the report; one that ends in .html is a page to browse. Default: "
            "reports/<recording>.pdf, or report.pdf in the results folder.",
            "FILE.pdf|FILE.html",
            callback=arguments.ending_in(".pdf", ".html", unnamed=(".htm", "")),
        ),
    ] = None,
    camera: arguments.Camera = None,
    quiet: arguments.Quiet = False,
) -> int:
    """Write the report of a drive or of a fleet, as a PDF or as a page.

        roadeval report recordings/drive.rrd -o drive.html
        roadeval report reports/drive -o drive.pdf

    It shows whether the filter helps, where the errors are, which stage causes them, and which
    frames to look at. A recording is enough; the report of a results folder has no pictures. A
    page is one file that needs no network and no server.
    """
    from roadeval.jobs.results.report import write_report
    from roadeval.jobs.results.result import Result

    opened = arguments.select_camera(Result(result), camera)
    with progress.show(quiet) as watch:
        path = write_report(opened, output, on_progress=watch)
    if not quiet:
        console.emit(str(path))
    for warning in opened.warnings:
        messages.warning(warning)
    return ExitCode.DONE
