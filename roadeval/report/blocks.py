"""What a document is made of: plain blocks, which `roadeval.report.typeset` sets on pages.

Text is text, never markup: whatever a log, a topic or a path is called is printed as it is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

Plain = dict[str, Any]
"""A block as JSON has it."""

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
class Heading:
    """A heading: level 1 is numbered and in the outline, and so is what lies below it."""

    text: str
    level: int = 1

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        return {"kind": "heading", "text": self.text, "level": self.level}

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        return iter(())


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph. ``style`` is ``body``, ``note`` (small and grey), ``title`` or ``verdict``."""

    text: str
    style: str = "body"

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        return {"kind": "text", "text": self.text, "style": self.style}

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        return iter(())


@dataclass(frozen=True, slots=True)
class Command:
    """A command to copy."""

    text: str

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        return {"kind": "command", "text": self.text}

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        return iter(())


@dataclass(frozen=True, slots=True)
class Points:
    """A titled list of sentences; ``tone`` is ``plain`` or ``warning``."""

    title: str
    items: Sequence[str]
    tone: str = "plain"

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        return {"kind": "points", "title": self.title, "items": [*self.items], "tone": self.tone}

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        return iter(())


@dataclass(frozen=True, slots=True)
class Cell:
    """A table's cell: its text, whether it is bold, and the colour of a dot before it."""

    text: str
    bold: bool = False
    dot: str | None = None

    def plain(self) -> Plain:
        """Give the cell as JSON has it."""
        return {"text": self.text, "bold": self.bold, "dot": self.dot}


@dataclass(frozen=True, slots=True)
class Table:
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

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        return {
            "kind": "table",
            "columns": [
                {"title": title.removeprefix("<"), "words": title.startswith("<")}
                for title in self.columns
            ],
            "rows": [[_cell(cell).plain() for cell in row] for row in self.rows],
            "breaks": [*self.breaks],
            "groups": [{"title": title, "span": span} for title, span in self.groups],
            "caption": self.caption,
            "small": self.small,
        }

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        return iter(())


@dataclass(frozen=True, slots=True)
class Figure:
    """A picture across ``width`` of the text (0..1), with its caption below."""

    picture: Asset
    caption: str
    width: float = 1.0

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        return {
            "kind": "figure",
            "picture": self.picture.name,
            "caption": self.caption,
            "width": self.width,
        }

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        yield self.picture


@dataclass(frozen=True, slots=True)
class Strip:
    """Pictures of equal size in rows of ``columns``, each with a few words below it.

    ``skip`` leaves as many places of the first row free.
    """

    pictures: Sequence[tuple[str, Asset]]
    columns: int
    skip: int = 0

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        pictures = [{"title": title, "picture": asset.name} for title, asset in self.pictures]
        return {
            "kind": "strip",
            "pictures": pictures,
            "columns": self.columns,
            "skip": self.skip,
        }

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        return (asset for _, asset in self.pictures)


@dataclass(frozen=True, slots=True)
class Together:
    """Blocks that no page break may part."""

    blocks: Sequence[Block]

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        return {"kind": "together", "blocks": [block.plain() for block in self.blocks]}

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        return (asset for block in self.blocks for asset in block.assets())


@dataclass(frozen=True, slots=True)
class Columns:
    """Two stacks of blocks side by side; the left one takes ``share`` of the width."""

    left: Sequence[Block]
    right: Sequence[Block]
    share: float = 0.5

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        left, right = ([block.plain() for block in side] for side in (self.left, self.right))
        return {"kind": "columns", "left": left, "right": right, "share": self.share}

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        return (asset for block in (*self.left, *self.right) for asset in block.assets())


@dataclass(frozen=True, slots=True)
class Contents:
    """The document's headings with their pages."""

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        return {"kind": "contents"}

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        return iter(())


@dataclass(frozen=True, slots=True)
class Break:
    """What follows begins on a new page."""

    def plain(self) -> Plain:
        """Give the block as JSON has it."""
        return {"kind": "break"}

    def assets(self) -> Iterator[Asset]:
        """Yield the pictures in it."""
        return iter(())


Block = (
    Heading
    | Text
    | Command
    | Points
    | Table
    | Figure
    | Strip
    | Together
    | Columns
    | Contents
    | Break
)


@dataclass(frozen=True, slots=True)
class Document:
    """A document: its titles, its blocks, and the facts of its metadata.

    ``kicker`` is the line above the title, ``subtitle`` the one below; ``footer`` stands at the
    foot of every page.
    """

    kicker: str
    title: str
    subtitle: str
    footer: str
    blocks: Sequence[Block]
    keywords: Sequence[str] = ()

    def plain(self) -> Plain:
        """Give the document as JSON has it."""
        return {
            "kicker": self.kicker,
            "title": self.title,
            "subtitle": self.subtitle,
            "footer": self.footer,
            "keywords": [*self.keywords],
            "blocks": [block.plain() for block in self.blocks],
        }

    def assets(self) -> Mapping[str, bytes]:
        """Give every picture's bytes by its name."""
        found = (asset for block in self.blocks for asset in block.assets())
        return {asset.name: asset.content for asset in found}


def _cell(cell: Cell | str) -> Cell:
    return cell if isinstance(cell, Cell) else Cell(cell)
