"""``roadeval report``: the report of a drive or of a fleet, as a PDF or as a page."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from roadeval.cli import arguments, console, messages
from roadeval.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from roadeval.jobs.result import DriveResult
    from roadeval.report.findings import Commands


def _ending(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() not in (".pdf", ".html", ".htm", ""):
        raise typer.BadParameter(f"{path}: end it in .pdf or .html")
    return path


def report(
    result: arguments.Result,
    *,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE.pdf|FILE.html",
            callback=_ending,
            help="A page to browse where it ends in .html. Default: reports/<recording>.pdf, or "
            "report.pdf in the folder given.",
            readable=False,
        ),
    ] = None,
    paper: arguments.PaperSize = "a4",
    pictures: Annotated[
        int | None,
        typer.Option(
            "--pictures",
            metavar="N",
            min=0,
            help="Of a page: frames with pictures. Default: as many as keep it below 10 MB.",
        ),
    ] = None,
    assets: Annotated[
        bool,
        typer.Option(
            "--assets", help="Of a page: script, style and pictures in a folder beside it."
        ),
    ] = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Write the report of a drive or of a fleet, as a PDF or as a page.

    Does the filter help, where are the errors, which stage broke it, and the frames to look at;
    from the recording alone, or from a results folder, then without pictures. A page is one file
    that needs no network and no server; of a fleet its pictures lie in a folder beside it.
    """
    from roadeval.jobs.report import PageSettings, is_page, write_report
    from roadeval.jobs.result import DriveResult
    from roadeval.results.fleet.kind import is_fleet

    size = arguments.paper_of(paper)
    if (pictures is not None or assets) and not (output and is_page(output)):
        raise typer.BadParameter("--pictures and --assets go with a page alone: -o FILE.html")
    page = PageSettings(pictures, assets)
    warnings: Sequence[str] = ()
    if is_fleet(result):
        told = commands_of(result)
        path = write_report(result, output, paper=size, commands=told, as_page=page)
    else:
        read = DriveResult(result)
        path = write_report(read, output, paper=size, commands=commands_of(read), as_page=page)
        warnings = read.warnings
    if not quiet:
        console.emit(str(path))
    for warning in warnings:
        messages.warning(warning)
    return ExitCode.DONE


def commands_of(result: DriveResult | Path) -> Commands:
    """Return what to type for more about a drive's result, or about a fleet's folder."""
    return _of_fleet(result) if isinstance(result, Path) else _of_drive(result)


def inspect_command(path: Path, frame: int) -> str:
    """Return the command that opens a frame of a recording in the viewer."""
    return shlex.join(["roadeval", "inspect", str(path), "--frame", str(frame)])


def _of_drive(result: DriveResult) -> Commands:
    from roadeval.report.findings import Commands

    config = result.configuration
    return Commands(
        again=None
        if config is None
        else lambda log: shlex.join(["roadeval", "replay", log, "--config", str(config)]),
        inspect=lambda frame: inspect_command(result.viewable or result.path, frame),
    )


def _of_fleet(path: Path) -> Commands:
    """Return the command that opens one of a fleet's worst frames, by its rank."""
    from roadeval.report.findings import Commands

    def inspect(rank: int) -> str:
        return shlex.join(["roadeval", "inspect", str(path), "--worst", str(rank)])

    return Commands(again=None, inspect=inspect)


COMMAND: Final = report
