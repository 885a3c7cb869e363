"""Blocks rendered as a page for a browser by Jinja.

Jinja (BSD-3-Clause, with MarkupSafe 0.8 MB) escapes every value that a template prints, so that no
text of a log can become markup; Typst's own HTML has neither pictures nor style. A page asks for
nothing from anywhere: its content policy allows its own script, style and pictures alone.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, Final, NoReturn

from roadeval.report.blocks import Block, Cell, Document, ImageFile, Table
from roadeval.report.browse import FrameBrowser
from roadeval.report.chart import legend
from roadeval.report.drawing import Drawing, HeatDrawing, drawn, span_of_frames
from roadeval.report.page.outline import charts, sections
from roadeval.runtime.text import visible

STYLE: Final = "page.css"
SCRIPT: Final = "page.js"
"""Names of the files with a page's style and script, where they are not inside it."""
_SCRIPTS: Final = ("tables.js", "charts.js", "places.js", "pictures.js", "frames.js", "start.js")
_MEDIA: Final = {"svg": "image/svg+xml", "png": "image/png", "jpg": "image/jpeg"}


@dataclass(frozen=True, slots=True)
class Place:
    """Where a page finds what belongs to it."""

    pictures: str | None = None
    code: str | None = None
    """Begin of the addresses of pictures, and of style and script; None: inside the page."""
    frames: str | None = None
    """Address of a frame, with ``{}`` for its number, where a server gives it; None: all that the
    page shows is on it.
    """
    home: str = ""
    home_title: str = "All results"
    """Address of the page above, or empty, and what it is called."""
    forms: bool = False
    """Whether a form of the page may ask its server to open the viewer, as without a script."""

    @property
    def policy(self) -> str:
        """The content security policy: nothing but the page's own parts."""
        return "; ".join(
            [
                "default-src 'none'",
                f"img-src data:{' ' + _BESIDE if self.pictures is not None else ''}",
                f"style-src {_hash(style()) if self.code is None else _BESIDE}",
                f"script-src {_hash(script()) if self.code is None else _BESIDE}",
                *(["connect-src 'self'"] if self.frames else []),
                "base-uri 'none'",
                f"form-action {_BESIDE if self.forms else _NOWHERE}",
            ]
        )


_BESIDE: Final = "'self'"
_NOWHERE: Final = "'none'"
INSIDE: Final = Place()


def page(document: Document, place: Place = INSIDE) -> bytes:
    """Return a document as a page in UTF-8; equal documents give equal bytes.

    Parameters
    ----------
    document
        What is shown.
    place
        Where it finds its parts; where those are beside it, somebody else puts them there.
    """
    found = sections(document.blocks)
    return _rendered(
        "page.html",
        place,
        document,
        doc=document,
        sections=found,
        policy=place.policy,
        code_at=place.code,
        home=place.home,
        home_title=place.home_title,
        style=style(),
        script=script(),
    )


def part(block: Block, place: Place) -> bytes:
    """Return one block as a part of a page."""
    return _rendered("part.html", place, None, block=block)


@cache
def style() -> str:
    """Return the style sheet of every page."""
    return _asset(STYLE)


@cache
def script() -> str:
    """Return the script of every page."""
    parts = "\n".join(map(_asset, _SCRIPTS))
    return f'"use strict";\n(() => {{\n{parts}}})();\n'


def _asset(name: str) -> str:
    return files("roadeval.report.page").joinpath("assets", name).read_text("utf-8")


def _hash(code: str) -> str:
    digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
    return f"'sha256-{digest}'"


def _rendered(template: str, place: Place, document: Document | None, **values: Any) -> bytes:
    span = span_of_frames(_all_charts(document)) if document else None

    def drawing(chart: Any) -> Drawing | HeatDrawing:
        return drawn(chart, span)

    environment = _environment()
    made = environment.get_template(template).render(
        drawn=drawing,
        legend=legend,
        picture=lambda chart: ImageFile(chart.picture()),
        source=lambda image: _source(image, place),
        frame_link=lambda frame: _frame_link(frame, place),
        filled=_filled,
        unknown=_unknown,
        is_live=place.frames is not None,
        has_forms=place.forms,
        # A picture inside the page is there already, and paper shows it only if it is loaded.
        loading="eager" if place.pictures is None else "lazy",
        **values,
    )
    return str(made).encode("utf-8")


@cache
def _environment() -> Any:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    templates = files("roadeval.report.page").joinpath("templates")
    made = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        loader=FunctionLoader(lambda name: templates.joinpath(name).read_text("utf-8")),
        trim_blocks=True,
        finalize=_shown,
    )
    made.filters["tojson_text"] = lambda value: json.dumps(value, separators=(",", ":"))
    return made


def _shown(value: Any) -> Any:
    """Return a text as `roadeval.runtime.text.visible` does; anything else as it is."""
    return visible(value) if type(value) is str else value


def _all_charts(document: Document) -> Iterator[Any]:
    yield from charts(document.blocks)
    for block in document.blocks:
        if isinstance(block, FrameBrowser):
            yield from block.charts


def _source(image: ImageFile, place: Place) -> str:
    if place.pictures is not None:
        return f"{place.pictures}{image.name}"
    media = _MEDIA[image.name.rpartition(".")[2]]
    return f"data:{media};base64,{base64.b64encode(image.content).decode()}"


def _frame_link(frame: int, place: Place) -> str:
    return f"#frame-{frame}" if place.frames is None else place.frames.format(frame)


# --- Tables ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Row:
    """A row's cells, each with whether it repeats the one above, and its classes."""

    cells: Sequence[tuple[Cell | str, bool]]
    classes: str


def _filled(table: Table) -> Iterator[_Row]:
    """Yield a table's rows; a word that is left out, as it is that of the row above, is there.

    So a row means the same wherever sorting puts it.
    """
    above: dict[int, Cell | str] = {}
    for place, row in enumerate(table.rows):
        cells: list[tuple[Cell | str, bool]] = []
        for column, cell in enumerate(row):
            again = cell == "" and column in table.text_columns and column in above
            if not again:
                above[column] = cell
            cells.append((above[column] if again else cell, again))
        total = all(isinstance(cell, Cell) and cell.bold for cell in row)
        rule = place in table.breaks
        yield _Row(cells, " ".join([*(["rule"] if rule else []), *(["total"] if total else [])]))


def _unknown(kind: str) -> NoReturn:
    raise NotImplementedError(f"templates/blocks.html draws no {kind}")


def code() -> Mapping[str, bytes]:
    """Return the files of style and script, for pages that have them beside them."""
    return {STYLE: style().encode(), SCRIPT: script().encode()}
