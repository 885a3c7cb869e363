"""A report of one drive, from its recording or results folder, or of a fleet."""

from __future__ import annotations

from pathlib import Path

from roadeval.jobs.outputs import holding
from roadeval.jobs.report_findings import collect
from roadeval.jobs.report_fleet import collect_fleet
from roadeval.jobs.result import Result
from roadeval.report.drive import document
from roadeval.report.findings import Commands
from roadeval.report.fleet.document import document as fleet_document
from roadeval.report.pdf.typeset import Paper, pdf, write_file
from roadeval.results.fleet.folder import Fleet, is_fleet


def write_report(
    result: str | Path | Result,
    output: str | Path | None = None,
    *,
    paper: Paper = Paper.A4,
    commands: Commands | None = None,
) -> Path:
    """Write the report of one drive, or of a fleet, as a PDF.

    Parameters
    ----------
    result
        A recording, whole or partial, or a results folder, or either opened already, or a
        fleet's folder. Without a recording there are no pictures of a single drive.
    output
        By default ``report.pdf`` in the folder, or ``reports/<recording>.pdf``.
    paper
        A4 or Letter.
    commands
        What the reader may type for more; none by default.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    RoadevalError
        If there is nothing to read there, or the file cannot be written.
    """
    if not isinstance(result, Result) and is_fleet(result):
        return _write_fleet(Fleet(result), output, paper)
    opened = result if isinstance(result, Result) else Result(result)
    beside = opened.path / "report.pdf"
    usual = beside if opened.recording is None else Path("reports", f"{opened.path.stem}.pdf")
    path = Path(output or usual)
    with holding(path, inputs=[opened.path]):
        return write_file(path, pdf(document(collect(opened, commands)), paper))


def _write_fleet(fleet: Fleet, output: str | Path | None, paper: Paper) -> Path:
    path = Path(output or fleet.path / "report.pdf")
    with holding(path, inputs=[fleet.path]):
        return write_file(path, pdf(fleet_document(collect_fleet(fleet)), paper))
