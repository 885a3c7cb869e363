"""Documents as files, by their endings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from roadeval.errors import RoadevalError
from roadeval.report.blocks import Report
from roadeval.report.pdf.typeset import typeset, write_file


def write_document(
    path: Path,
    title: str,
    document: Callable[[], Report],
    markdown: Callable[[], str],
    json: Callable[[], str],
) -> Path:
    """Write a document as PDF, page, Markdown or JSON, by the file's ending.

    A `RoadevalError`, with the document's ``title``, if the ending is another, or the file cannot
    be written.
    """
    match path.suffix.lower():
        case ".pdf":
            content = typeset(document())
        case ".html":
            from roadeval.report.page.render import page

            content = page(document())
        case ".md":
            content = markdown().encode()
        case ".json":
            content = json().encode()
        case _:
            raise RoadevalError(f"{path}: {title} is written as .pdf, .html, .md, .json")
    return write_file(path, content)
