"""``roadeval report``: the report of a drive or of a fleet, as a PDF or as a page."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from roadeval.jobs.results.result import Result
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
    camera: arguments.Camera = None,
    quiet: arguments.Quiet = False,
) -> int:
    """Write the report of a drive or of a fleet, as a PDF or as a page.

    Does the filter help, where are the errors, which stage broke it, and the frames to look at;
    from the recording alone, or from a results folder, then without pictures. A page is one file
    that needs no network and no server; of a fleet its pictures lie in a folder beside it.
    """
    from roadeval.jobs.results.report import PageSettings, is_page, write_report
    from roadeval.jobs.results.result import Result

    size = arguments.paper_of(paper)
    if (pictures is not None or assets) and not (output and is_page(output)):
        raise typer.BadParameter("--pictures and --assets go with a page alone: -o FILE.html")
    page, opened = PageSettings(pictures, assets), arguments.of_camera(Result(result), camera)
    with progress.watched(quiet) as watch:
        path = write_report(
            opened,
            output,
            paper=size,
            commands=commands_of(opened),
            as_page=page,
            on_progress=watch,
        )
    if not quiet:
        console.emit(str(path))
    for warning in opened.warnings:
        messages.warning(warning)
    return ExitCode.DONE


def commands_of(result: Result) -> Commands:
    """Return what to type for more about a result: of a fleet, by the rank of a worst frame."""
    from roadeval.report.findings import Commands
    from roadeval.results.fleet import recording_path

    (path,) = result.paths
    if fleet := result.fleet:
        rows = fleet.table("worst", ["rank", "drive"]).to_pylist()
        kept = {row["rank"] for row in rows if recording_path(path, row["drive"]).exists()}
        worst = ["roadeval", "inspect", str(path), "--worst"]

        def inspect(rank: int) -> str:
            replayed = [] if rank in kept else ["--trust-sources"]
            return shlex.join([*worst, str(rank), *replayed])

        return Commands(again=None, inspect=inspect)
    drive = result.rig.cameras[0] if result.rig else result.drive
    assert drive is not None
    config, shown = drive.configuration, drive.viewable or path
    camera = drive.camera if result.drive else ""
    return Commands(
        again=None
        if config is None
        else lambda log: shlex.join(["roadeval", "replay", log, "--config", str(config)]),
        inspect=lambda frame: inspect_command(shown, frame, camera),
        of_camera=lambda name: commands_of(result.cameras[name]),
    )


def inspect_command(path: Path, frame: int, camera: str = "") -> str:
    """Return the command that opens a frame of a recording, or of its camera, in the viewer."""
    of = ["--camera", camera] if camera else []
    return shlex.join(["roadeval", "inspect", str(path), *of, "--frame", str(frame)])


COMMAND: Final = report
