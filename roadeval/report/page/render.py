"""Blocks rendered as a page for a browser by Jinja.

Jinja (BSD-3-Clause, with MarkupSafe 0.8 MB) escapes every value that a template prints, so no text
of a log can become markup. Typst, which makes the PDF, writes HTML without pictures and style. A
page loads nothing: its content policy allows only its own script, style and pictures.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.resources import files
from itertools import chain, count
from typing import Any, Final, NoReturn

from roadeval.data.words import MINUS
from roadeval.report.blocks import Block, Cell, Heading, ImageFile, KeepTogether, Report, Table
from roadeval.report.captions import caption
from roadeval.report.chart import Chart, legend
from roadeval.report.drawing import place_chart, range_of_frames, values
from roadeval.report.sections.frames import FrameBrowser
from roadeval.runtime.text import visible

_SCRIPTS: Final = (
    *("tables.js", "choice.js", "charts.js", "places.js", "rates.js", "film.js", "pictures.js"),
    *("frames.js", "start.js"),
)
_SETTING: Final = re.compile(r"`([a-z_]+\.[a-z_.]+|[a-z_]+ = [^`]+)`")
"""A setting, or a line of a configuration, between backticks."""
_MEDIA: Final = {"png": "image/png", "jpg": "image/jpeg", "webm": "video/webm"}
POLICY: Final = (
    "default-src 'none'; img-src data:; media-src data:; style-src {}; script-src {}; "
    "base-uri 'none'; form-action 'none'"
)
"""The content security policy: it allows only the page's own parts."""


def page(document: Report) -> bytes:
    """Return a document as a page in UTF-8; equal documents give equal bytes."""
    parts = [*document.parts()]
    frames = range_of_frames(part for part in parts if isinstance(part, Chart))
    browsers = (part for part in parts if isinstance(part, FrameBrowser))
    variants = next((part.variants for part in browsers), ())
    template = _environment().get_template("page.html")
    html = template.render(
        doc=document,
        sections=sections(document.blocks),
        policy=POLICY.format(_hash(style()), _hash(script())),
        style=style(),
        script=script(),
        place_chart=lambda chart: place_chart(chart, frames),
        legend=legend,
        caption=caption,
        values=values,
        source=source,
        rows_of=rows_of,
        variants=variants,
        variant_of=partial(variant_of, variants),
        unknown=_unknown,
    )
    return html.encode("utf-8")


@cache
def style() -> str:
    """Return the style sheet of every page."""
    return _asset("page.css")


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


def variant_of(variants: Sequence[str], text: Cell | str) -> str:
    """Return the variant that a text begins with, such as "a: its mask"; empty without one."""
    words = text if isinstance(text, str) else text.text
    names = (v for v in variants if words == v or words.startswith((f"{v}: ", f"{v} {MINUS} ")))
    return next(names, "")


@cache
def _environment() -> Any:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    templates = files("roadeval.report.page").joinpath("templates")
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        loader=FunctionLoader(lambda name: templates.joinpath(name).read_text("utf-8")),
        trim_blocks=True,
        finalize=lambda value: visible(value) if type(value) is str else value,
    )
    environment.filters["parts"] = _SETTING.split
    environment.filters["tojson_text"] = lambda value: json.dumps(value, separators=(",", ":"))
    return environment


def source(image: ImageFile | bytes) -> str:
    """Return an image as a data URL."""
    image = ImageFile(image) if isinstance(image, bytes) else image
    media = _MEDIA[image.name.rpartition(".")[2]]
    return f"data:{media};base64,{base64.b64encode(image.content).decode()}"


def rows_of(table: Table) -> Iterator[tuple[list[tuple[Cell | str, bool]], str]]:
    """Yield the cells of each row, each with whether it repeats the cell above, and CSS classes.

    An omitted word is taken from the row above, so that a row keeps its meaning when the table is
    sorted.
    """
    above: dict[int, Cell | str] = {}
    for place, row in enumerate(table.rows):
        cells: list[tuple[Cell | str, bool]] = []
        for column, cell in enumerate(row):
            repeats = cell == "" and column in table.text_columns and column in above
            if not repeats:
                above[column] = cell
            cells.append((above[column] if repeats else cell, repeats))
        total = all(isinstance(cell, Cell) and cell.bold for cell in row)
        classes = {"rule": place in table.breaks, "total": total}
        yield cells, " ".join(name for name, holds in classes.items() if holds)


def _unknown(kind: str) -> NoReturn:
    raise NotImplementedError(f"templates/blocks.html draws no {kind}")


@dataclass(slots=True)
class Section:
    """A heading of the first level with the blocks below it."""

    name: str
    """The unique name that links use."""
    title: str
    """The text of the heading; empty before the first heading."""
    blocks: list[tuple[Block, str]] = field(default_factory=list)
    """The blocks below, each with its name if it is a heading."""

    @property
    def parts(self) -> list[tuple[str, str]]:
        """The names and titles of the headings below this one."""
        return [(name, block.text) for block, name in self.blocks if isinstance(block, Heading)]


def sections(blocks: Iterable[Block]) -> list[Section]:
    """Return the sections of a document; blocks that paper keeps together are ungrouped.

    >>> [section.name for section in sections([Heading("The frames"), Heading("The frames")])]
    ['the-frames', 'the-frames-2']
    """
    parts = [Section("", "")]
    taken: set[str] = set()
    for block in _flat(blocks):
        name = ""
        if isinstance(block, Heading):
            plain = re.sub(r"[^a-z0-9]+", "-", block.text.lower()).strip("-") or "part"
            names = chain([plain], (f"{plain}-{number}" for number in count(2)))
            name = next(name for name in names if name not in taken)
            taken.add(name)
        if isinstance(block, Heading) and block.level == 1:
            parts.append(Section(name, block.text))
        else:
            parts[-1].blocks.append((block, name))
    return [section for section in parts if section.title or section.blocks]


def _flat(blocks: Iterable[Block]) -> Iterator[Block]:
    for block in blocks:
        if isinstance(block, KeepTogether):
            yield from _flat(block.blocks)
        else:
            yield block
