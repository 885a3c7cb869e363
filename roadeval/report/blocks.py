"""Blocks that a document is made of.

`roadeval.report.pdf` sets them on paper, `roadeval.report.page` on a page for a browser. Text is
text, never markup: the name of a log, a topic or a path is printed as it is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Final

from roadeval.report.chart import Chart, HeatMap, legend
from roadeval.report.drawing import (
    Drawing,
    HeatDrawing,
    drawn,
    key_on_paper,
    span_of_frames,
)

_SUFFIXES: Final = {b"<?xml": "svg", b"\x89PNG": "png", b"\xff\xd8\xff": "jpg"}


@dataclass(frozen=True, slots=True)
class ImageFile:
    """The bytes of an SVG, PNG or JPEG file."""

    content: bytes = field(repr=False)

    @property
    def name(self) -> str:
        """File name inside the document: equal files have equal names."""
        suffix = next(s for head, s in _SUFFIXES.items() if self.content.startswith(head))
        return f"{hashlib.blake2b(self.content, digest_size=8).hexdigest()}.{suffix}"


@dataclass(frozen=True, slots=True)
class Block:
    """A part of a page."""

    @property
    def kind(self) -> str:
        """Its name for whoever draws it, as ``heading``."""
        return type(self).__name__.lower()

    def as_json(self) -> dict[str, Any]:
        """Return the block's kind and its fields as JSON has them; an image file by its name."""
        own = {each.name: _as_json(getattr(self, each.name)) for each in fields(self)}
        return {"kind": self.kind, **own}

    def images(self) -> Iterator[ImageFile]:
        """Yield the image files in the block and in those it holds."""
        for each in fields(self):
            yield from _images(getattr(self, each.name))


@dataclass(frozen=True, slots=True)
class Heading(Block):
    """A heading; one of level 1 is numbered. All are in the outline."""

    text: str
    level: int = 1


@dataclass(frozen=True, slots=True)
class Text(Block):
    """A paragraph. ``style`` is ``body``, ``note`` (small and grey), ``title`` or ``verdict``."""

    text: str
    style: str = "body"


@dataclass(frozen=True, slots=True)
class Command(Block):
    """A command to copy."""

    text: str


@dataclass(frozen=True, slots=True)
class BulletList(Block):
    """A titled list of sentences; ``tone`` is ``plain`` or ``warning``."""

    title: str
    items: Sequence[str]
    tone: str = "plain"


@dataclass(frozen=True, slots=True)
class Cell(Block):
    """A table's cell."""

    text: str
    """What it says."""
    bold: bool = False
    """Whether it is bold."""
    dot: str | None = None
    """Colour of a dot before it."""
    opens: str = ""
    """Address below that of a served page at which its frame is opened in the viewer; or empty."""
    leads: str = ""
    """Address below that of a served page to which it leads; or empty."""


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class Figure(Block):
    """Charts beside each other below one legend, with a caption."""

    charts: Sequence[Chart | HeatMap]
    caption: str

    def as_json(self) -> dict[str, Any]:
        """Return what paper needs to draw it."""
        span, keys = span_of_frames(self.charts), legend(self.charts)
        told = [f"{chart.title}, {chart.unit}" for chart in self.charts]
        return {
            "kind": self.kind,
            "caption": self.caption,
            "alt": f"{'; '.join(told)}: {', '.join(key.name for key in keys)}".rstrip(": "),
            "legend": [key_on_paper(key) for key in keys],
            "charts": [_on_paper(drawn(chart, span)) for chart in self.charts],
        }


@dataclass(frozen=True, slots=True)
class ImageGrid(Block):
    """Pictures of equal size in rows of ``columns``, each with a few words below it.

    The first ``skip`` places of the first row stay free.
    """

    pictures: Sequence[tuple[str, ImageFile]]
    columns: int
    skip: int = 0


@dataclass(frozen=True, slots=True)
class KeepTogether(Block):
    """Blocks with no page break between them."""

    blocks: Sequence[Block]


@dataclass(frozen=True, slots=True)
class TwoColumns(Block):
    """Two stacks of blocks side by side; the left one takes ``share`` of the width."""

    left: Sequence[Block]
    right: Sequence[Block]
    share: float = 0.5


@dataclass(frozen=True, slots=True)
class TableOfContents(Block):
    """The document's headings with their pages: of the first level, or down to a depth."""

    depth: int = 1


@dataclass(frozen=True, slots=True)
class PageBreak(Block):
    """The end of a page."""


@dataclass(frozen=True, slots=True)
class Document(Block):
    """A document: its titles, its blocks, and the keywords of the file.

    ``kicker`` is the line above the title, ``subtitle`` the one below; ``footer`` is printed at
    the foot of every page.
    """

    kicker: str
    title: str
    subtitle: str
    footer: str
    blocks: Sequence[Block]
    keywords: Sequence[str] = ()

    def files(self) -> Mapping[str, bytes]:
        """Return every image file's bytes by its name."""
        return {image.name: image.content for image in self.images()}


def _on_paper(drawing: Drawing | HeatDrawing) -> dict[str, Any]:
    if isinstance(drawing, HeatDrawing):
        return drawing.on_paper() | {"picture": ImageFile(drawing.chart.picture()).name}
    return drawing.on_paper()


def _as_json(value: Any) -> Any:
    match value:
        case ImageFile():
            return value.name
        case Block():
            return value.as_json()
        case list() | tuple() | range():
            return [_as_json(item) for item in value]
        case _:
            return value


def _images(value: Any) -> Iterator[ImageFile]:
    match value:
        case ImageFile():
            yield value
        case HeatMap():
            yield ImageFile(value.picture())
        case Block():
            yield from value.images()
        case list() | tuple():
            for item in value:
                yield from _images(item)
