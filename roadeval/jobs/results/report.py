"""The report of a result, as a PDF or as a page, and what it shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, Literal

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
from roadeval.report.page.render import page
from roadeval.report.pdf.typeset import typeset
from roadeval.report.writing import write_file
from roadeval.results.facts import FETCHED, Facts
from roadeval.results.fleet import FleetFolder
from roadeval.results.why import with_doubts
from roadeval.runtime.files import AnyPath, leads_outside, writing

PAGES: Final = (".html", ".htm")
"""Endings of files that are written as a page."""
PICTURED_OF_FLEET: Final = 60
"""Number of worst frames of a fleet that a page shows."""


def write_report(
    result: str | Path | Result,
    output: str | Path | None = None,
    *,
    focus: str | None = None,
    audit: AnyPath | None = None,
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
        A PDF, or a page with a name that ends in ``.html``. By default ``report.pdf`` in the
        folder, or ``reports/<recording>.pdf``.
    focus
        The variant that the report is about; see `roadeval.Result`, which has it if it was opened.
    audit
        The folder of an audit of the drive: what it says of the labels is told among the reasons.
    on_progress
        Called with each pictured frame of a page.
    """
    if output and Path(output).suffix.lower() not in (".pdf", "", *PAGES):
        raise RoadevalError("the name of a report must end in .pdf or .html", where=output)
    opened = result if isinstance(result, Result) else Result(result, focus=focus)
    (source,) = opened.paths
    name = opened.drive.camera if opened.drive else ""
    camera = f"-{as_plain(name)}" if name else ""
    usual = opened.recording or source in FETCHED
    beside = Path("reports", f"{source.stem}{camera}") if usual else source / f"report{camera}"
    path = Path(output or beside.with_name(f"{beside.name}.pdf"))
    if not (output or usual) and leads_outside(path, source):  # it may come from someone else
        raise RoadevalError(f"{path}: a link leads out of the folder; name the file to write")
    with holding(path, inputs=[source]):
        findings = findings_of(opened)
        if audit is not None:
            if opened.drive is None or not isinstance(findings, Findings):
                raise RoadevalError("an audit is of one camera of a drive", where=audit)
            from roadeval.jobs.results.audit import read_doubts

            doubts = read_doubts(audit, opened.drive)
            findings = replace(findings, facts=with_doubts(findings.facts, doubts))
        if path.suffix.lower() not in PAGES:
            return write_file(path, typeset(document(findings)))
        return write_file(path, page(_page_of(opened, findings, on_progress, path.parent)))


WIDTHS: Final = (4, 100)
"""Least and greatest width of a figure, in centimetres."""
_INCHES: Final = {"cm": 1 / 2.54, "mm": 1 / 25.4, "in": 1.0}


def inches_of(width: str) -> float:
    """Return a width in inches; a `RoadevalError` if no figure can have it.

    >>> inches_of("85mm") == inches_of("8.5 cm")
    True
    """
    number, unit = width[:-2], width[-2:]
    try:
        inches = float(number) * _INCHES[unit]
    except (ValueError, KeyError):
        inches = math.nan
    least, most = WIDTHS
    if not least - 1e-9 <= 2.54 * inches <= most + 1e-9:
        raise RoadevalError(
            f"{width} is not a width of a figure",
            remedy=f"write it as 8.5cm, 85mm or 3.35in, from {least} to {most} cm",
        )
    return inches


def write_figures(
    result: str | Path | Result,
    folder: str | Path,
    *,
    width: str = "16cm",
    title: Literal["drive", "none"] = "drive",
) -> list[Path]:
    """Write the paper's figures 2, 3a and 3b of a drive, each as PDF and SVG; return the files.

    A `RoadevalError` if the result is not of one drive or has nothing to draw, or a file cannot be
    written.

    Parameters
    ----------
    result
        A recording, or a results folder, which has no pictures for figure 2; or one of these opened
        already. Each camera of a rig has its own files.
    folder
        Made if it is not there. Files of these names are replaced.
    width
        Width of each figure, such as ``8.5cm``, ``85mm`` or ``3.35in``. Letters keep their size.
    title
        ``none`` leaves out the lines above a figure, for a text with captions of its own.
    """
    from roadeval.report import figures

    inches = inches_of(width)
    if title not in ("drive", "none"):
        raise RoadevalError(f"title must be drive or none (given: {title!r})")
    opened = result if isinstance(result, Result) else Result(result)
    drives = opened.rig or list(filter(None, [opened.drive]))
    if not drives:
        raise RoadevalError(
            "figures are of one drive", where=opened.paths[0], remedy="name the result of a drive"
        )
    names = short_names([drive.camera for drive in drives])
    files: list[Path] = []
    with writing(folder, RoadevalError):
        for drive in drives:
            files += figures.write_figures(
                *(Path(folder), drive.name, drive.table("windows")),
                [*FramePicker(drive).examples(_frames_of_figure_2(drive))],
                names[drive.camera] if opened.rig else "",
                width=inches,
                titled=title == "drive",
                kinds=("pdf", "svg"),
            )
    if not files:
        raise RoadevalError(
            "there is nothing to draw: neither pictures nor rates", where=opened.paths[0]
        )
    return files


def findings_of(result: Result) -> Findings | FleetFolder:
    """Collect what the report of a result shows."""
    if result.fleet:
        return result.fleet
    if not result.rig:
        assert result.drive is not None
        return collect(result.drive)
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


def _page_of(
    result: Result, findings: Findings | FleetFolder, on_progress: OnProgress, folder: Path
) -> Report:
    """Return the page of a result, for a folder, as a document with its most telling frames."""
    if result.drive is None:
        return page_document(findings, None, PICTURED_OF_FLEET, folder)
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
"""Number of frames in figure 2 and on the first page."""


def _pictured(result: DriveResult) -> list[int]:
    """Return the evaluated frames with pictures; if there are none, all frames with pictures."""
    evaluated = {*result.rows["frame"]} or {*result.pictured}
    return [number for number in result.pictured if number in evaluated]


def _frames_of_figure_2(result: DriveResult) -> Sequence[int]:
    drawn = result.facts.examples
    is_there = drawn and set(drawn) <= set(result.pictured)
    return drawn if is_there else evenly(_pictured(result), EXAMPLES)


def collect(result: DriveResult) -> Findings:
    """Collect everything that the report of a drive shows."""
    regions = result.table("regions", final=True)  # it takes the most memory, so it is first
    pictured, picker = _pictured(result), FramePicker(result)
    worst = picker.worst()
    return Findings(
        path=str(result.path),
        facts=result.facts,
        table=lambda name: regions if name == "regions" else result.table(name),
        complete=result.complete,
        again=result.again,
        inspect=result.inspect if result.viewable else None,
        properties=result.properties,
        pictured=len(pictured),
        examples=[*picker.examples(_frames_of_figure_2(result))],
        thumbnails=[*picker.thumbnails(evenly(pictured, THUMBNAILS))],
        worst=worst,
        helped=picker.moved([], harmed=False),
        harmed=picker.moved(worst, harmed=True),
        camera=result.camera,
    )
