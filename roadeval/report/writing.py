"""Documents as files: PDF, page, Markdown and JSON by their endings."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from roadeval.errors import RoadevalError
from roadeval.report.blocks import Report
from roadeval.report.pdf.typeset import typeset
from roadeval.runtime.files import put, writing


def write_file(path: Path, content: bytes) -> Path:
    """Write a file and return its path; an incomplete file never has the name.

    A `RoadevalError` if it cannot be written.
    """
    with writing(path, partial(RoadevalError, remedy="choose another place")):
        put(path, content)
    return path


def write_document(
    path: Path,
    title: str,
    document: Callable[[], Report],
    markdown: Callable[[], str],
    facts: Callable[[], str],
) -> Path:
    """Write a document as PDF, page, Markdown or JSON, by the file's ending; return its path.

    A `RoadevalError` if the ending is another, with the document's ``title``, or if the file cannot
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
            content = facts().encode()
        case _:
            raise RoadevalError(f"{path}: {title} is written as .pdf, .html, .md or .json")
    return write_file(path, content)
