"""The report of a result, as a PDF or as a page."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.jobs.outputs import holding
from roadeval.jobs.report_findings import WORST_OF_FLEET, collect, collect_fleet
from roadeval.jobs.report_frames import browsed, strips_of
from roadeval.jobs.result import Result
from roadeval.report.blocks import Document
from roadeval.report.document import document, page_document
from roadeval.report.findings import Commands, Findings, FleetFindings
from roadeval.report.page.render import Beside, page, write_page
from roadeval.report.pdf.typeset import Paper, pdf, write_file
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
    result: str | Path | Result,
    output: str | Path | None = None,
    *,
    paper: Paper = Paper.A4,
    commands: Commands | None = None,
    as_page: PageSettings = PageSettings(),
) -> Path:
    """Write the report of a drive, or of a fleet, as a PDF or as a page for a browser.

    Parameters
    ----------
    result
        A recording, whole or partial, a results folder, or a fleet's folder; or one of these opened
        already. Without a recording there are no pictures of a single drive.
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
    opened = result if isinstance(result, Result) else Result(result)
    (source,) = opened.paths
    usual = Path("reports", f"{source.stem}.pdf") if opened.recording else None
    path = Path(output or usual or _beside(source))
    with holding(path, inputs=[source]):
        if not is_page(path):
            return write_file(path, pdf(document(findings_of(opened, commands)), paper))
        kept = Beside.PICTURES if opened.fleet else Beside.NOTHING
        made = page_of(opened, commands, as_page.pictures)
        return write_page(path, made, Beside.ALL if as_page.assets else kept)


def findings_of(
    result: Result, commands: Commands | None, worst: int = WORST_OF_FLEET
) -> Findings | FleetFindings:
    """Collect what the report of a result shows, with so many of a fleet's worst frames."""
    if result.fleet:
        return collect_fleet(result.fleet, commands.inspect if commands else None, worst)
    assert result.drive is not None
    return collect(result.drive, commands)


def _beside(folder: Path) -> Path:
    """Return where the report of a folder lies; its other files may be somebody else's."""
    path = folder / "report.pdf"
    if leads_outside(path, folder):
        raise RoadevalError(f"{path}: a link leads out of the folder; name the file to write")
    return path


def is_page(path: Path) -> bool:
    """Return whether a file's name asks for a page."""
    return path.suffix.lower() in PAGES


def page_of(
    result: Result, commands: Commands | None = None, pictures: int | None = None
) -> Document:
    """Return the page of a result as a document, with so many pictured frames.

    Of a drive by default as many as `roadeval.jobs.report_frames.strips_of` says.
    """
    findings = findings_of(result, commands, pictures or PICTURED)
    if result.drive is None:
        return page_document(findings, None)
    drive, inspect = result.drive, commands.inspect if commands else None
    frames = browsed(drive, inspect)
    taken = len(page(page_document(findings, frames))) if pictures is None else 0
    strips, left_out = strips_of(drive, inspect, pictures, taken)
    return page_document(findings, replace(frames, strips=strips, left_out=left_out))
