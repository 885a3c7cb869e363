"""A report of one drive, from its recording or results folder, or of a fleet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.jobs.outputs import holding
from roadeval.jobs.page_frames import browsed, strips_of
from roadeval.jobs.report_findings import collect
from roadeval.jobs.report_fleet import collect_fleet
from roadeval.jobs.result import DriveResult
from roadeval.report.blocks import Document
from roadeval.report.drive import document, page_document, with_frames
from roadeval.report.findings import Commands
from roadeval.report.fleet.document import document as fleet_document
from roadeval.report.fleet.document import page_document as fleet_page_document
from roadeval.report.page.render import Beside, page, write_page
from roadeval.report.pdf.typeset import Paper, pdf, write_file
from roadeval.results.fleet.folder import Fleet
from roadeval.results.fleet.kind import is_fleet
from roadeval.runtime.files import leads_outside

PAGES: Final = (".html", ".htm")
"""Endings of files that are written as a page."""
PICTURED: Final = 60
"""Worst frames of a fleet that a page shows."""


@dataclass(frozen=True, slots=True)
class PageSettings:
    """The settings of a page."""

    pictures: int | None = None
    """Frames with pictures; by default as many as keep the page of a drive below 10 MB."""
    assets: bool = False
    """Whether script, style and pictures lie in a folder beside it."""


def write_report(
    result: str | Path | DriveResult,
    output: str | Path | None = None,
    *,
    paper: Paper = Paper.A4,
    commands: Commands | None = None,
    as_page: PageSettings = PageSettings(),
) -> Path:
    """Write the report of one drive, or of a fleet, as a PDF or as a page for a browser.

    Parameters
    ----------
    result
        A recording, whole or partial, or a results folder, or either opened already, or a
        fleet's folder. Without a recording there are no pictures of a single drive.
    output
        By default ``report.pdf`` in the folder, or ``reports/<recording>.pdf``. A name that ends
        in ``.html`` gives a page.
    paper
        A4 or Letter.
    commands
        What the reader may type for more; none by default.
    as_page
        What a page is made like.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    RoadevalError
        If there is nothing to read there, or the file cannot be written.
    """
    if not isinstance(result, DriveResult) and is_fleet(result):
        return _write_fleet(Fleet(result), output, paper, commands, as_page)
    opened = result if isinstance(result, DriveResult) else DriveResult(result)
    usual = Path("reports", f"{opened.path.stem}.pdf") if opened.recording else None
    path = Path(output or usual or _beside(opened.path))
    with holding(path, inputs=[opened.path]):
        if is_page(path):
            kept = Beside.ALL if as_page.assets else Beside.NOTHING
            return write_page(path, drive_page(opened, commands, as_page.pictures), kept)
        return write_file(path, pdf(document(collect(opened, commands)), paper))


def _beside(folder: Path) -> Path:
    """Return where the report of a folder lies; its other files may be somebody else's."""
    path = folder / "report.pdf"
    if leads_outside(path, folder):
        raise RoadevalError(f"{path}: a link leads out of the folder; name the file to write")
    return path


def is_page(path: Path) -> bool:
    """Return whether a file's name asks for a page."""
    return path.suffix.lower() in PAGES


def drive_page(
    opened: DriveResult, commands: Commands | None = None, pictures: int | None = None
) -> Document:
    """Return the page of a drive as a document.

    Parameters
    ----------
    opened
        The drive's result.
    commands
        What the reader may type for more.
    pictures
        Frames with pictures, see `roadeval.jobs.page_frames.strips_of`.
    """
    inspect = commands.inspect if commands else None
    findings, frames = collect(opened, commands), browsed(opened, inspect)
    without = page_document(findings, frames)
    taken = len(page(without)) if pictures is None else 0
    strips, left_out = strips_of(opened, inspect, pictures, taken)
    return with_frames(without, replace(frames, strips=strips, left_out=left_out))


def _write_fleet(
    fleet: Fleet,
    output: str | Path | None,
    paper: Paper,
    commands: Commands | None,
    as_page: PageSettings,
) -> Path:
    path = Path(output or _beside(fleet.path))
    with holding(path, inputs=[fleet.path]):
        inspect = commands.inspect if commands else None
        if is_page(path):
            found = collect_fleet(fleet, inspect, as_page.pictures or PICTURED)
            kept = Beside.ALL if as_page.assets else Beside.PICTURES
            return write_page(path, fleet_page_document(found), kept)
        return write_file(path, pdf(fleet_document(collect_fleet(fleet, inspect)), paper))
