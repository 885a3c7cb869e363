"""Blocks that a document is made of.

`roadeval.report.pdf` sets them on paper, `roadeval.report.page` on a page for a browser. Text is
text, never markup: the name of a log, a topic or a path is printed as it is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Final

from roadeval.report.chart import Chart, legend
from roadeval.report.drawing import drawn, span_of_frames
from roadeval.runtime.text import as_markdown

_SUFFIXES: Final = {b"\x89PNG": "png", b"\xff\xd8\xff": "jpg"}


@dataclass(frozen=True)
class ImageFile:
    """The bytes of a PNG or JPEG file."""

    content: bytes = field(repr=False)

    @property
    def name(self) -> str:
        """File name inside the document: equal files have equal names."""
        suffix = next(s for head, s in _SUFFIXES.items() if self.content.startswith(head))
        return f"{hashlib.blake2b(self.content, digest_size=8).hexdigest()}.{suffix}"


@dataclass(frozen=True)
class Block:
    """A part of a page."""

    @property
    def kind(self) -> str:
        """Its name in templates, as ``heading``."""
        return type(self).__name__.lower()

    def as_json(self) -> dict[str, Any]:
        """Return the block's kind and its fields as JSON has them; an image file by its name."""
        return {"kind": self.kind, **_fields(self)}

    def parts(self) -> Iterator[Any]:
        """Yield the image files, the charts and the blocks inside, and what is inside of those."""
        for each in fields(self):
            yield from _parts(getattr(self, each.name))

    def images(self) -> Iterator[ImageFile]:
        """Yield the image files in the block and in those it holds."""
        yield from (part for part in self.parts() if isinstance(part, ImageFile))


def _fields(value: Any) -> dict[str, Any]:
    return {each.name: _as_json(getattr(value, each.name)) for each in fields(value)}


def _as_json(value: Any) -> Any:
    match value:
        case ImageFile():
            return value.name
        case Block():
            return value.as_json()
        case list() | tuple():
            return [_as_json(item) for item in value]
        case _:
            return _fields(value) if is_dataclass(value) else value


def _parts(value: Any) -> Iterator[Any]:
    if isinstance(value, list | tuple):
        for item in value:
            yield from _parts(item)
    elif isinstance(value, ImageFile | Chart):
        yield value
    elif isinstance(value, Block):
        yield value
        yield from value.parts()


@dataclass(frozen=True)
class Heading(Block):
    """A heading; one of level 1 is numbered. All are in the outline."""

    text: str
    level: int = 1


@dataclass(frozen=True)
class Text(Block):
    """A paragraph."""

    text: str
    style: str = "body"
    """``body``, ``note`` (small and grey), ``title`` or ``verdict``."""


@dataclass(frozen=True)
class Command(Block):
    """A command to copy."""

    text: str


@dataclass(frozen=True)
class BulletList(Block):
    """A titled list of sentences."""

    title: str
    items: Sequence[str]
    tone: str = "plain"
    """``plain`` or ``warning``."""


@dataclass(frozen=True)
class Cell(Block):
    """A table's cell."""

    text: str
    bold: bool = False
    dot: str | None = None
    """The colour of a dot before the text."""


@dataclass(frozen=True)
class Table(Block):
    """A table."""

    columns: Sequence[str]
    """Titles."""
    rows: Sequence[Sequence[Cell | str]]
    """As many cells each as there are columns."""
    text_columns: Sequence[int] = (0,)
    """Positions of the columns of words, which are aligned left; numbers are aligned right."""
    breaks: Sequence[int] = ()
    """Rows above which a thin rule is drawn."""
    groups: Sequence[tuple[str, int]] = ()
    """Titles above several columns, each with its number of columns; together all columns."""
    caption: str = ""
    """Printed above the table."""
    small: bool = False
    """Whether it is set in small type."""
    find: str = ""
    """On a page: what stands before a field that looks for words in a table of many rows."""


def blocks_as_markdown(blocks: Iterable[Block]) -> str:
    """Return headings, texts, lists and tables as Markdown; other blocks are left out."""
    lines: list[str] = []
    for block in blocks:
        match block:
            case Heading():
                lines += [f"{'#' * (block.level + 1)} {as_markdown(block.text)}", ""]
            case Text():
                lines += [as_markdown(block.text), ""]
            case BulletList():
                lines += [f"**{as_markdown(block.title)}**", ""]
                lines += [*(f"- {as_markdown(item)}" for item in block.items), ""]
            case Table():
                lines += [as_markdown(block.caption), ""] if block.caption else []
                lines += [*_table_lines(block), ""]
    return "\n".join(lines).rstrip() + "\n"


def _table_lines(table: Table) -> list[str]:
    sides = ["---" if p in table.text_columns else "---:" for p in range(len(table.columns))]
    rows = [[as_markdown(plain(cell)) for cell in row] for row in table.rows]
    return [f"| {' | '.join(cells)} |" for cells in (table.columns, sides, *rows)]


def plain(cell: Cell | str) -> str:
    """Return the text of a table's cell."""
    return cell.text if isinstance(cell, Cell) else cell


@dataclass(frozen=True)
class Figure(Block):
    """Charts beside each other below one legend, with a caption."""

    charts: Sequence[Chart]
    caption: str

    def as_json(self) -> dict[str, Any]:
        """Return what paper needs to draw it."""
        span, keys = span_of_frames(self.charts), legend(self.charts)
        titles = "; ".join(f"{chart.title}, {chart.unit}" for chart in self.charts)
        return {
            "kind": self.kind,
            "caption": self.caption,
            "alt": f"{titles}: {', '.join(key.name for key in keys)}".rstrip(": "),
            "legend": _as_json(keys),
            "charts": _as_json([drawn(chart, span) for chart in self.charts]),
        }


@dataclass(frozen=True)
class ImageGrid(Block):
    """Pictures of equal size in rows, each with a few words below it."""

    pictures: Sequence[tuple[str, ImageFile]]
    columns: int
    skip: int = 0
    """Places of the first row that stay free, on paper."""
    caption: str = ""
    """Printed below all of them."""


@dataclass(frozen=True)
class KeepTogether(Block):
    """Blocks with no page break between them."""

    blocks: Sequence[Block]


@dataclass(frozen=True)
class Details(Block):
    """Blocks that a page shows after a click on their title."""

    title: str
    blocks: Sequence[Block]
    on_paper: bool = True
    """Whether paper has them, below their title as a heading."""


@dataclass(frozen=True)
class TwoColumns(Block):
    """Two stacks of blocks side by side; the left one takes ``share`` of the width."""

    left: Sequence[Block]
    right: Sequence[Block]
    share: float = 0.5


@dataclass(frozen=True)
class TableOfContents(Block):
    """The document's headings with their pages: of the first level, or down to a depth."""

    depth: int = 1


@dataclass(frozen=True)
class Report(Block):
    """A report of sections, or a single figure without ``footer``."""

    title: str
    subtitle: str
    """The line below the title."""
    blocks: Sequence[Block]
    kicker: str = ""
    """The line above the title."""
    footer: str = ""
    """The line at the foot of every page."""
    keywords: Sequence[str] = ()
    """Keywords of the file."""

    def files(self) -> Mapping[str, bytes]:
        """Return every image file's bytes by its name."""
        return {image.name: image.content for image in self.images()}


@dataclass(frozen=True)
class Picture(Block):
    """A picture of a strip."""

    name: str
    """The same in every frame, as ``filtered: errors``: kept when the frame changes."""
    title: str
    """What it shows, in a few words."""
    image: ImageFile


@dataclass(frozen=True)
class Strip(Block):
    """A frame with its pictures."""

    frame: int
    sentences: Sequence[str]
    """What is known of it."""
    rates: Table | None
    """Of each variant's final mask; None without truth."""
    rows: Sequence[Sequence[Picture]]
    """The outcomes, then the layers of each variant."""
    command: str = ""
    """Opens it in the viewer; empty without a recording."""


@dataclass(frozen=True)
class LinkList(Block):
    """Titles with the addresses that they lead to; paper has none."""

    links: Sequence[tuple[str, str]]
    command: str = ""
    """What to type next, after the links."""
