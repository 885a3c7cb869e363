"""A report of one drive from its recording or results folder."""

from __future__ import annotations

from pathlib import Path

from roadeval.jobs.outputs import holding
from roadeval.jobs.report_findings import collect
from roadeval.jobs.result import Result
from roadeval.report.drive import document
from roadeval.report.findings import Commands
from roadeval.report.pdf.typeset import Paper, pdf, write_file


def write_report(
    result: str | Path | Result,
    output: str | Path | None = None,
    *,
    paper: Paper = Paper.A4,
    commands: Commands | None = None,
) -> Path:
    """Write the report of one drive as a PDF.

    Parameters
    ----------
    result
        A recording, whole or partial, or a results folder, or either opened already. Without a
        recording there are no pictures.
    output
        By default ``report.pdf`` in the results folder, or ``reports/<recording>.pdf``.
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
    opened = result if isinstance(result, Result) else Result(result)
    beside = opened.path / "report.pdf"
    usual = beside if opened.recording is None else Path("reports", f"{opened.path.stem}.pdf")
    path = Path(output or usual)
    with holding(path, inputs=[opened.path]):
        return write_file(path, pdf(document(collect(opened, commands)), paper))
