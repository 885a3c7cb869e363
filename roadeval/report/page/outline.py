"""A document's blocks as sections with names that links can lead to."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from roadeval.report.blocks import (
    Block,
    Figure,
    Heading,
    KeepTogether,
    PageBreak,
    TableOfContents,
    TwoColumns,
)
from roadeval.report.chart import Chart, HeatMap

_PAPER = (PageBreak, TableOfContents)
"""What only paper has: a page's navigation is always there."""


@dataclass(slots=True)
class Section:
    """A heading of the first level with all that follows it."""

    name: str
    """Of the place, for links; no two are equal."""
    title: str
    """Of the heading; empty for what stands before the first one."""
    blocks: list[tuple[Block, str]] = field(default_factory=list)
    """What follows, with the names of the headings among them."""

    @property
    def parts(self) -> list[tuple[str, str]]:
        """The names and titles of the headings below this one."""
        return [(name, block.text) for block, name in self.blocks if isinstance(block, Heading)]


def sections(blocks: Iterable[Block]) -> list[Section]:
    """Return the sections of a document; blocks that were only kept together stand for themselves.

    >>> [section.name for section in sections([Heading("The frames"), Heading("The frames")])]
    ['the-frames', 'the-frames-2']
    """
    found = [Section("", "")]
    taken: set[str] = set()
    for block in _flat(blocks):
        name = _name(block.text, taken) if isinstance(block, Heading) else ""
        if isinstance(block, Heading) and block.level == 1:
            found.append(Section(name, block.text))
        else:
            found[-1].blocks.append((block, name))
    return [section for section in found if section.title or section.blocks]


def charts(blocks: Iterable[Block]) -> Iterator[Chart | HeatMap]:
    """Yield every chart of a document."""
    for block in _flat(blocks):
        if isinstance(block, Figure):
            yield from block.charts
        elif isinstance(block, TwoColumns):
            yield from charts((*block.left, *block.right))


def _flat(blocks: Iterable[Block]) -> Iterator[Block]:
    for block in blocks:
        if isinstance(block, KeepTogether):
            yield from _flat(block.blocks)
        elif not isinstance(block, _PAPER):
            yield block


def _name(text: str, taken: set[str]) -> str:
    """Return a name of letters, digits and hyphens that nothing on the page has yet."""
    plain = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "part"
    name, count = plain, 1
    while name in taken:
        count += 1
        name = f"{plain}-{count}"
    taken.add(name)
    return name
