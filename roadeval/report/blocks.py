"""The blocks of a document.

`roadeval.report.pdf` sets them on paper, `roadeval.report.page` on a page for a browser. Text is
text, never markup: the name of a log, a topic or a path is printed as it is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Final

from roadeval.report.chart import Chart, Look, legend
from roadeval.report.drawing import place_chart, range_of_frames
from roadeval.results.facts import Reason
from roadeval.runtime.text import as_markdown, visible

_SUFFIXES: Final = {b"\x89PNG": "png", b"\xff\xd8\xff": "jpg", b"\x1a\x45\xdf\xa3": "webm"}


@dataclass(frozen=True)
class ImageFile:
    """The bytes of a PNG or JPEG file, or of a WebM video."""

    content: bytes = field(repr=False)

    @property
    def name(self) -> str:
        """The file's name inside the document; equal files have equal names."""
        suffix = next(s for head, s in _SUFFIXES.items() if self.content.startswith(head))
        return f"{hashlib.blake2b(self.content, digest_size=8).hexdigest()}.{suffix}"


@dataclass(frozen=True)
class Block:
    """A part of a page."""

    @property
    def kind(self) -> str:
        """The block's name in templates, such as ``heading``."""
        return type(self).__name__.lower()

    def as_json(self) -> dict[str, Any]:
        """Return the block's kind and its fields for JSON; an image file becomes its name.

        `roadeval.runtime.text.visible` is applied to every text.
        """
        return {"kind": self.kind, **_fields(self)}

    def parts(self) -> Iterator[Any]:
        """Yield all image files, charts and blocks that the block and its blocks hold."""
        for part in fields(self):
            yield from _parts(getattr(self, part.name))

    def images(self) -> Iterator[ImageFile]:
        """Yield all image files that the block and its blocks hold."""
        yield from (part for part in self.parts() if isinstance(part, ImageFile))


def _fields(value: Any) -> dict[str, Any]:
    return {part.name: _as_json(getattr(value, part.name)) for part in fields(value)}


def _as_json(value: Any) -> Any:
    match value:
        case str():
            return visible(value)
        case ImageFile():
            return value.name
        case Reason():
            return visible(value.text)
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
    """A heading in the outline; headings of level 1 are numbered."""

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
    items: Sequence[str | Reason]
    """Sentences and reasons; a page makes links of the frames that a reason names."""
    tone: str = "plain"
    """``plain`` or ``warning``."""
    focus: str = ""
    """The variant that must be the focus for a page to show the list; always shown if empty."""
    on_paper: bool = True


@dataclass(frozen=True)
class Cell(Block):
    """A table's cell."""

    text: str
    bold: bool = False
    """Whether it is the best of its column, or of its row."""
    look: Look | None = None
    """The look of its variant in charts; the mark stands before the text."""
    frames: Sequence[int] = ()
    """Numbers of the frames that the text lists; on a page they are links."""


@dataclass(frozen=True)
class Table(Block):
    """A table."""

    columns: Sequence[str]
    """Titles of the columns."""
    rows: Sequence[Sequence[Cell | str]]
    """Rows with a cell for each column."""
    text_columns: Sequence[int] = (0,)
    """Positions of the columns of words, which are aligned left; numbers are aligned right."""
    breaks: Sequence[int] = ()
    """Rows with a thin rule above them."""
    groups: Sequence[tuple[str, int]] = ()
    """Titles above groups of columns, each with its number of columns; no column is left out."""
    caption: str = ""
    """The text above the table."""
    small: bool = False
    """Whether it is set in small type."""
    name: str = ""
    """Name by which the script of a page looks it up."""
    find: str = ""
    """The label of a field on a page that searches words in a table of many rows."""


def blocks_as_markdown(blocks: Iterable[Block]) -> str:
    """Return headings, texts, lists and tables as Markdown, without other blocks.

    A heading with nothing left below it is omitted, too.
    """
    from_last: list[Block] = []
    for block in reversed([*blocks]):
        below = from_last[-1:]
        if isinstance(block, Heading):
            if below and not (isinstance(below[0], Heading) and below[0].level <= block.level):
                from_last.append(block)
        elif isinstance(block, Text | BulletList | Table):
            from_last.append(block)
    lines: list[str] = []
    for block in reversed(from_last):
        match block:
            case Heading():
                lines += [f"{'#' * (block.level + 1)} {as_markdown(block.text)}", ""]
            case Text():
                lines += [as_markdown(block.text), ""]
            case BulletList():
                lines += [f"**{as_markdown(block.title)}**", ""]
                lines += [*(f"- {as_markdown(plain(item))}" for item in block.items), ""]
            case Table():
                lines += [as_markdown(block.caption), ""] if block.caption else []
                places = range(len(block.columns))
                sides = ["---" if p in block.text_columns else "---:" for p in places]
                rows = [[as_markdown(plain(cell)) for cell in row] for row in block.rows]
                lines += [f"| {' | '.join(cells)} |" for cells in (block.columns, sides, *rows)]
                lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def plain(item: Cell | Reason | str) -> str:
    """Return the text of a cell of a table or of an item of a list."""
    return item if isinstance(item, str) else item.text


@dataclass(frozen=True)
class Figure(Block):
    """Charts beside each other below one legend, with a caption."""

    charts: Sequence[Chart]
    caption: str

    def as_json(self) -> dict[str, Any]:
        """Return the placed charts and their legend."""
        frames, entries = range_of_frames(self.charts), legend(self.charts)
        titles = "; ".join(f"{chart.title}, {chart.unit}" for chart in self.charts)
        names = ", ".join(entry.name for entry in entries)
        return {
            "kind": self.kind,
            "caption": visible(self.caption),
            "alt": visible(f"{titles}: {names}".rstrip(": ")),
            "legend": _as_json(entries),
            "charts": _as_json([place_chart(chart, frames) for chart in self.charts]),
        }


@dataclass(frozen=True)
class ImageGrid(Block):
    """Pictures of equal size in rows, with a few words below each picture."""

    pictures: Sequence[tuple[str, ImageFile]]
    columns: int
    skip: int = 0
    """Number of places at the start of the first row that stay empty on paper."""
    caption: str = ""
    """The text below all pictures."""


@dataclass(frozen=True)
class KeepTogether(Block):
    """Blocks without a page break between them."""

    blocks: Sequence[Block]


@dataclass(frozen=True)
class Details(Block):
    """Blocks that a page shows after a click on their title."""

    title: str
    blocks: Sequence[Block]
    on_paper: bool = True
    """Whether paper shows them, below their title as a heading."""


@dataclass(frozen=True)
class TwoColumns(Block):
    """Two stacks of blocks side by side; ``share`` is the left stack's part of the width."""

    left: Sequence[Block]
    right: Sequence[Block]
    share: float = 0.5


@dataclass(frozen=True)
class Report(Block):
    """A report: a title and blocks."""

    title: str
    subtitle: str
    """The line below the title."""
    blocks: Sequence[Block]
    kicker: str
    """The line above the title."""
    footer: str
    """The line at the foot of every page."""
    keywords: Sequence[str] = ()
    """Keywords of the file."""

    def files(self) -> Mapping[str, bytes]:
        """Return the bytes of every image file by its name."""
        return {image.name: image.content for image in self.images()}


@dataclass(frozen=True)
class Picture(Block):
    """A picture of a frame."""

    name: str
    """A name such as ``filtered: errors``, the same in every frame, so that a page keeps showing
    this picture from frame to frame."""
    title: str
    """A few words on its content."""
    image: ImageFile


@dataclass(frozen=True)
class Strip(Block):
    """A frame with its pictures."""

    frame: int
    sentences: Sequence[str]
    rates: Table | None
    """Rates of each variant's final mask; None without truth."""
    rows: Sequence[Sequence[Picture]]
    """A row of pictures of the outcomes, then a row for each variant with its layers."""
    command: str = ""
    """The command that opens the frame in the viewer; empty without a recording."""


@dataclass(frozen=True)
class DriveRow(Block):
    """One of many drives on a page: its error rate along the drive, and its worst frames."""

    name: str
    note: str
    chart: Chart
    address: str = ""
    """The address of the drive's page; empty without one."""
    pictures: Sequence[tuple[str, ImageFile]] = ()


@dataclass(frozen=True)
class LinkList(Block):
    """Titles of links with their addresses; paper shows no links."""

    links: Sequence[tuple[str, str]]
    command: str = ""
    """The command to type next, after the links."""
