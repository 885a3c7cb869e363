"""Pages as files: one, or one with a folder beside it that holds pictures, style and script."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

from roadeval.report.blocks import Document
from roadeval.report.page.render import Place, code, page
from roadeval.report.pdf.typeset import ReportError
from roadeval.runtime.companions import folder_name, put_with


class Beside(StrEnum):
    """What lies in a folder beside a page: nothing, its pictures, or its script and style, too."""

    NOTHING = "nothing"
    PICTURES = "pictures"
    ALL = "all"


def write_page(path: Path, document: Document, beside: Beside = Beside.NOTHING) -> Path:
    """Write a document as a page; what it needs is replaced with it, as one.

    Raises
    ------
    ReportError
        If it cannot be written.
    """
    files = dict(document.files() if beside is not Beside.NOTHING else {})
    files |= code() if beside is Beside.ALL else {}
    at = f"{folder_name(path, files)}/" if files else None
    place = Place(
        pictures=None if beside is Beside.NOTHING else at,
        code=at if beside is Beside.ALL else None,
    )
    try:
        put_with(path, page(document, place), files)
    except OSError as error:
        raise ReportError(
            f"{path}: cannot be written ({error.strerror}); choose another place"
        ) from error
    return path
