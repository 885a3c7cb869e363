"""Blocks that only a page has: frames to sort, to filter and to look at, and drives likewise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from roadeval.report.blocks import Block, ImageFile, Table
from roadeval.report.chart import Chart


@dataclass(frozen=True, slots=True)
class Picture(Block):
    """A picture of a strip.

    Parameters
    ----------
    name
        The same in every frame, as ``filtered: errors``; who looks at one goes on with it.
    title
        What it shows, in a few words.
    image
        Its file.
    """

    name: str
    title: str
    image: ImageFile


@dataclass(frozen=True, slots=True)
class PictureRow(Block):
    """Pictures that stand beside each other under a title."""

    title: str
    pictures: Sequence[Picture]


@dataclass(frozen=True, slots=True)
class Strip(Block):
    """A frame with its pictures.

    Parameters
    ----------
    frame
        Its number.
    sentences
        What is known of it.
    rates
        Of each variant's final mask; None without truth.
    rows
        Its pictures.
    command
        Opens it in the viewer; empty where there is none.
    """

    frame: int
    sentences: Sequence[str]
    rates: Table | None
    rows: Sequence[PictureRow]
    command: str = ""


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
    """The frames of a drive.

    Parameters
    ----------
    rates
        Titles of groups of columns.
    variants
        Titles of the columns in each group.
    rows
        The frames, in the drive's order.
    conditions
        What a frame can be, in words.
    strips
        Frames with pictures, in the drive's order; none where they are asked for one by one.
    charts
        Rates along the drive.
    first
        The frame that is shown at first; None where there is no picture.
    compared
        Names of two pictures that are laid over each other at first.
    command
        Opens a frame in the viewer, with ``{}`` for its number; empty where nothing does.
    note
        What to know of the table.
    """

    rates: Sequence[str]
    variants: Sequence[str]
    rows: Sequence[FrameRow]
    conditions: Sequence[str]
    strips: Sequence[Strip]
    charts: Sequence[Chart]
    first: int | None
    compared: tuple[str, str]
    command: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class LongTable(Block):
    """A table of many rows, with a field that looks for words in them."""

    table: Table
    label: str


@dataclass(frozen=True, slots=True)
class LinkList(Block):
    """Titles with the addresses that they lead to, which a server made."""

    links: Sequence[tuple[str, str]]
