"""Tables and text as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from roadeval.report.blocks import Cell, Table


def table(block: Table) -> list[str]:
    """Return the lines of a table."""
    sides = [
        "---" if place in block.text_columns else "---:" for place in range(len(block.columns))
    ]
    rows: Sequence[Sequence[str]] = [
        [escaped(cell.text if isinstance(cell, Cell) else cell) for cell in row]
        for row in block.rows
    ]
    return [f"| {' | '.join(cells)} |" for cells in (block.columns, sides, *rows)]


def escaped(text: str) -> str:
    r"""Return text with everything escaped that Markdown would take for markup.

    >>> print(escaped("a*b"))
    a\*b
    """
    return "".join(f"\\{letter}" if letter in "\\`*_[]<>|#" else letter for letter in text)
