"""``roadeval report``: the report of a drive or of a fleet, or the paper's figures of a drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal

import typer

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.exit_codes import ExitCode

WIDTH: Final = "16cm"
TITLE: Final = "drive"


def _check_width(width: str) -> str:
    from roadeval.jobs.results.report import inches_of

    with arguments.usage():
        inches_of(width)
    return width


Output = Annotated[
    Path | None,
    arguments.option(
        "-o --output",
        "File of the report; one that ends in .html is a page to browse. Default: "
        "reports/<recording>.pdf, or report.pdf in the results folder.",
        "FILE.pdf|FILE.html",
        callback=arguments.ending_in(".pdf", ".html", unnamed=(".htm", "")),
    ),
]
Figures = Annotated[
    Path | None,
    arguments.option(
        "--figures",
        "Folder for the paper's figures 2, 3a and 3b as PDF and SVG, in place of the report. "
        "Figure 2 needs a recording.",
        "DIR",
    ),
]
Width = Annotated[
    str,
    arguments.option(
        "--width",
        "Width of each figure, as 8.5cm, 85mm or 3.35in; letters keep their size.",
        "LENGTH",
        callback=_check_width,
    ),
]
Title = Annotated[
    Literal["drive", "none"],
    arguments.option(
        "--title",
        "Title of each figure: what it shows and the drive's name; or none, for a text with "
        "captions of its own.",
    ),
]
Opened = Annotated[
    bool, arguments.option("--open", "Open the report in the browser, or in the PDF viewer.")
]
Audit = Annotated[
    Path | None,
    arguments.option(
        "--audit",
        "Folder of 'roadeval audit': the report begins with what it says of the labels.",
        "FOLDER",
    ),
]


def report(
    result: arguments.Result,
    *,
    output: Output = None,
    focus: arguments.Focus = None,
    figures: Figures = None,
    width: Width = WIDTH,
    title: Title = TITLE,
    open_report: Opened = False,
    audit: Audit = None,
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
    if not figures and (width, title) != (WIDTH, TITLE):
        raise typer.BadParameter("--width and --title are of --figures: give them with it")
    if figures and audit and not output:
        raise typer.BadParameter("--audit is of a report: give --output, too")
    from roadeval.jobs.results.report import write_figures, write_report
    from roadeval.jobs.results.result import Result

    opened = arguments.select_camera(Result(result, focus=focus), camera)
    paths = write_figures(opened, figures, width=width, title=title) if figures else []
    if output or not figures:
        with progress.show(quiet) as watch:
            paths.append(write_report(opened, output, audit=audit, on_progress=watch))
    for path in paths if not quiet else ():
        console.emit(str(path))
    messages.warning(*opened.warnings)
    if open_report:
        typer.launch(str(paths[-1]))
    return ExitCode.DONE
