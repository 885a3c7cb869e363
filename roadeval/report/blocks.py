"""What a document is made of: plain blocks, which `roadeval.report.pdf.typeset` sets on pages.

Text is text, never markup: whatever a log, a topic or a path is called is printed as it is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Final

SUFFIXES: Final = {b"<?xml": "svg", b"\x89PNG": "png", b"\xff\xd8\xff": "jpg"}


@dataclass(frozen=True, slots=True)
class Asset:
    """A picture: the bytes of an SVG, PNG or JPEG file."""

    content: bytes = field(repr=False)

    @property
    def name(self) -> str:
        """File name inside the document: equal pictures have equal names."""
        suffix = next(s for head, s in SUFFIXES.items() if self.content.startswith(head))
        return f"{hashlib.blake2b(self.content, digest_size=8).hexdigest()}.{suffix}"


@dataclass(frozen=True, slots=True)
class Block:
    """Anything that stands on a page; its fields are all that the page is told of it."""

    def plain(self) -> dict[str, Any]:
        """Give the block as JSON has it: its kind, and its fields; a picture by its name."""
        own = {each.name: _plain(getattr(self, each.name)) for each in fields(self)}
        return {"kind": type(self).__name__.lower(), **own}

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        for each in fields(self):
            yield from _assets(getattr(self, each.name))


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
class Points(Block):
    """A titled list of sentences; ``tone`` is ``plain`` or ``warning``."""

    title: str
    items: Sequence[str]
    tone: str = "plain"


@dataclass(frozen=True, slots=True)
class Cell(Block):
    """A table's cell: its text, whether it is bold, and the colour of a dot before it."""

    text: str
    bold: bool = False
    dot: str | None = None


@dataclass(frozen=True, slots=True)
class Table(Block):
    """A table. Columns of numbers stand right, of words left.

    Parameters
    ----------
    columns
        Titles; one that begins with ``<`` heads a column of words.
    rows
        As many cells each as there are columns.
    breaks
        Rows above which a thin rule stands.
    groups
        Titles above several columns, each with its number of columns; together all columns.
    caption
        Stands above the table.
    small
        Whether it is set in small type.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[Cell | str]]
    breaks: Sequence[int] = ()
    groups: Sequence[tuple[str, int]] = ()
    caption: str = ""
    small: bool = False


@dataclass(frozen=True, slots=True)
class Figure(Block):
    """A picture across ``width`` of the text (0..1), with its caption below."""

    picture: Asset
    caption: str
    width: float = 1.0


@dataclass(frozen=True, slots=True)
class Strip(Block):
    """Pictures of equal size in rows of ``columns``, each with a few words below it.

    ``skip`` leaves as many places of the first row free.
    """

    pictures: Sequence[tuple[str, Asset]]
    columns: int
    skip: int = 0


@dataclass(frozen=True, slots=True)
class Together(Block):
    """Blocks that no page break may part."""

    blocks: Sequence[Block]


@dataclass(frozen=True, slots=True)
class Columns(Block):
    """Two stacks of blocks side by side; the left one takes ``share`` of the width."""

    left: Sequence[Block]
    right: Sequence[Block]
    share: float = 0.5


@dataclass(frozen=True, slots=True)
class Contents(Block):
    """The document's headings with their pages."""


@dataclass(frozen=True, slots=True)
class Break(Block):
    """What follows begins on a new page."""


@dataclass(frozen=True, slots=True)
class Document(Block):
    """A document: its titles, its blocks, and the words that a search finds it by.

    ``kicker`` is the line above the title, ``subtitle`` the one below; ``footer`` stands at the
    foot of every page.
    """

    kicker: str
    title: str
    subtitle: str
    footer: str
    blocks: Sequence[Block]
    keywords: Sequence[str] = ()

    def files(self) -> Mapping[str, bytes]:
        """Give every picture's bytes by its name."""
        return {asset.name: asset.content for asset in self.assets()}


def _plain(value: Any) -> Any:
    match value:
        case Asset():
            return value.name
        case Block():
            return value.plain()
        case list() | tuple():
            return [_plain(item) for item in value]
        case _:
            return value


def _assets(value: Any) -> Iterator[Asset]:
    match value:
        case Asset():
            yield value
        case Block():
            yield from value.assets()
        case list() | tuple():
            for item in value:
                yield from _assets(item)
