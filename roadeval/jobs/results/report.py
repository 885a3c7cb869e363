"""The report of a result, as a PDF or as a page, and what it shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from roadeval.data import as_plain
from roadeval.data.words import short_names
from roadeval.errors import RoadevalError
from roadeval.jobs.outputs import holding
from roadeval.jobs.progress import OnProgress, ignore
from roadeval.jobs.results.frames import FramePicker, evenly
from roadeval.jobs.results.page import BYTES, FILM_BYTES, browsed, film_of, strips_of
from roadeval.jobs.results.result import DriveResult, Result
from roadeval.report.blocks import Report
from roadeval.report.document import document, page_document
from roadeval.report.findings import Findings
from roadeval.report.page.render import page, write_page
from roadeval.report.pdf.typeset import typeset, write_file
from roadeval.results.facts import Facts
from roadeval.results.fleet import FleetFolder
from roadeval.runtime.files import leads_outside

PAGES: Final = (".html", ".htm")
"""Endings of files that are written as a page."""
PICTURED_OF_FLEET: Final = 60
"""Worst frames of a fleet that a page shows."""


def write_report(
    result: str | Path | Result,
    output: str | Path | None = None,
    *,
    focus: str | None = None,
    on_progress: OnProgress = ignore,
) -> Path:
    """Write the report of a drive, or of a fleet, as a PDF or as a page for a browser.

    A `RoadevalError` if there is nothing to read there, or no such focus, or the file cannot be
    written.

    Parameters
    ----------
    result
        A recording, whole or partial, a results folder, or a fleet's folder; or one of these opened
        already. Without a recording there are no pictures of a single drive.
    output
        By default ``report.pdf`` in the folder, or ``reports/<recording>.pdf``. A name that ends
        in ``.html`` gives a page.
    focus
        The variant that the report is about; see `roadeval.Result`, which has it if it was opened.
    on_progress
        Called with each pictured frame of a page.
    """
    opened = result if isinstance(result, Result) else Result(result, focus=focus)
    (source,) = opened.paths
    name = opened.drive.camera if opened.drive else ""
    camera = f"-{as_plain(name)}" if name else ""
    usual = Path("reports", f"{source.stem}{camera}.pdf") if opened.recording else None
    path = Path(output or usual or source / f"report{camera}.pdf")
    if not (output or usual) and leads_outside(path, source):  # it may come from someone else
        raise RoadevalError(f"{path}: a link leads out of the folder; name the file to write")
    with holding(path, inputs=[source]):
        if path.suffix.lower() not in PAGES:
            return write_file(path, typeset(document(findings_of(opened))))
        return write_page(path, page_of(opened, on_progress))


def findings_of(result: Result) -> Findings | FleetFolder:
    """Collect what the report of a result shows."""
    if result.fleet:
        return result.fleet
    if result.rig:
        return collect_rig(result)
    assert result.drive is not None
    return collect(result.drive)


def page_of(result: Result, on_progress: OnProgress = ignore) -> Report:
    """Return the page of a result as a document, with its most telling frames."""
    findings = findings_of(result)
    if result.drive is None:
        return page_document(findings, None, PICTURED_OF_FLEET)
    frames = browsed(result.drive)
    room = BYTES - len(page(page_document(findings, frames)))
    film = film_of(result.drive, min(room // 2, FILM_BYTES * len(frames.rows)), on_progress)
    frames = replace(frames, film=film)
    strips = strips_of(
        result.drive, room - len(film.content) * 4 // 3 if film else room, on_progress
    )
    return page_document(findings, replace(frames, strips=strips))


EXAMPLES: Final = 4
THUMBNAILS: Final = 4
"""Frames in figure 2 and on the first page."""


def collect(result: DriveResult) -> Findings:
    """Collect everything that the report of a drive shows."""
    evaluated = {*result.rows["frame"]} or {*result.pictured}
    pictured = [number for number in result.pictured if number in evaluated]
    picker, drawn = FramePicker(result), result.facts.examples
    if not set(drawn) <= set(result.pictured):
        drawn = []
    worst = picker.worst()
    return Findings(
        path=str(result.path),
        facts=result.facts,
        table=result.table,
        complete=result.complete,
        again=result.again,
        inspect=result.inspect if result.viewable else None,
        properties=result.properties,
        pictured=len(pictured),
        examples=[*picker.examples(drawn or evenly(pictured, EXAMPLES))],
        thumbnails=[*picker.thumbnails(evenly(pictured, THUMBNAILS))],
        worst=worst,
        helped=picker.moved([], harmed=False),
        harmed=picker.moved(worst, harmed=True),
        camera=result.camera,
    )


def collect_rig(result: Result) -> Findings:
    """Collect everything that the report of several cameras shows."""
    by_camera = {drive.camera: collect(drive) for drive in result.rig}
    first, names, facts = next(iter(by_camera.values())), short_names([*by_camera]), result.facts
    assert isinstance(facts, Facts)
    return Findings(
        path=first.path,
        facts=facts,
        complete=first.complete,
        again=first.again,
        pictured=sum(findings.pictured for findings in by_camera.values()),
        thumbnails=[
            replace(image, title=f"{names[camera]}, {image.title}")
            for camera, findings in by_camera.items()
            for image in findings.thumbnails[:1]
        ],
        cameras=by_camera,
    )
