"""Tables as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from roadeval.report.blocks import Cell, Table
from roadeval.runtime.text import as_markdown


def table(block: Table) -> list[str]:
    """Return the lines of a table."""
    sides = [
        "---" if place in block.text_columns else "---:" for place in range(len(block.columns))
    ]
    rows: Sequence[Sequence[str]] = [
        [as_markdown(cell.text if isinstance(cell, Cell) else cell) for cell in row]
        for row in block.rows
    ]
    return [f"| {' | '.join(cells)} |" for cells in (block.columns, sides, *rows)]
