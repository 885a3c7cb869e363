"""A report of one drive from its recording or results folder."""

from __future__ import annotations

from pathlib import Path

from roadeval.opened import Opened
from roadeval.report.document import document
from roadeval.report.typeset import Paper, pdf, put
from roadeval.reporting.finding import find

__all__ = ["find", "report"]


def report(
    result: str | Path | Opened, output: str | Path | None = None, *, paper: Paper = Paper.A4
) -> Path:
    """Write the report of one drive as a PDF.

    Parameters
    ----------
    result
        A recording, whole or partial, or a results folder, or either opened already. Without a
        recording there are no pictures.
    output
        By default ``report.pdf`` in the results folder, or ``reports/<drive>/report.pdf``.
    paper
        A4 or Letter.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    RoadevalError
        If there is nothing to read there, or the file cannot be written.
    """
    opened = result if isinstance(result, Opened) else Opened(result)
    folder = opened.path if opened.recording is None else Path("reports", opened.name)
    return put(Path(output or folder / "report.pdf"), pdf(document(find(opened)), paper))
