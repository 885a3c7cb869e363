"""Blocks that only a page has: frames to sort, to filter and to look at, and drives likewise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from roadeval.report.blocks import Block, ImageFile, Table
from roadeval.report.chart import Chart


@dataclass(frozen=True, slots=True)
class Picture(Block):
    """A picture of a strip."""

    name: str
    """The same in every frame, as ``filtered: errors``; who looks at one goes on with it."""
    title: str
    """What it shows, in a few words."""
    image: ImageFile
    """Its file."""


@dataclass(frozen=True, slots=True)
class PictureRow(Block):
    """Pictures that stand beside each other under a title."""

    title: str
    pictures: Sequence[Picture]


@dataclass(frozen=True, slots=True)
class Strip(Block):
    """A frame with its pictures."""

    frame: int
    """Its number."""
    sentences: Sequence[str]
    """What is known of it."""
    rates: Table | None
    """Of each variant's final mask; None without truth."""
    rows: Sequence[PictureRow]
    """Its pictures."""
    command: str = ""
    """Opens it in the viewer; empty where there is none."""


@dataclass(frozen=True, slots=True)
class FrameRow(Block):
    """A frame in the table: its time from the first one, and a number for each column of rates.

    ``conditions`` are positions in `FrameBrowser.conditions`; ``pictured`` tells whether its
    pictures can be had.
    """

    frame: int
    seconds: str
    cells: Sequence[str]
    conditions: Sequence[int] = ()
    note: str = ""
    pictured: bool = False


@dataclass(frozen=True, slots=True)
class FrameBrowser(Block):
    """The frames of a drive."""

    rates: Sequence[str]
    """Titles of groups of columns."""
    variants: Sequence[str]
    """Titles of the columns in each group."""
    rows: Sequence[FrameRow]
    """The frames, in the drive's order."""
    conditions: Sequence[str]
    """What a frame can be, in words."""
    strips: Sequence[Strip]
    """Frames with pictures, in the drive's order; none where they are asked for one by one."""
    charts: Sequence[Chart]
    """Rates along the drive."""
    first: int | None
    """The frame that is shown at first; None where there is no picture."""
    compared: tuple[str, str]
    """Names of two pictures that are laid over each other at first."""
    command: str = ""
    """Opens a frame in the viewer, with ``{}`` for its number; empty where nothing does."""
    note: str = ""
    """What to know of the table."""


@dataclass(frozen=True, slots=True)
class LongTable(Block):
    """A table of many rows, with a field that looks for words in them."""

    table: Table
    label: str


@dataclass(frozen=True, slots=True)
class LinkList(Block):
    """Titles with the addresses that they lead to, which a server made."""

    links: Sequence[tuple[str, str]]
