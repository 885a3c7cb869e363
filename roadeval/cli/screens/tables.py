"""Tables and numbers for the terminal: numbers are ASCII alone, whatever its encoding."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import words
from roadeval.evaluation.stats import Difference
from roadeval.results.sentences import MARK, stands

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

GAP: Final = 2
"""Spaces between columns."""
LONGEST: Final = 20
"""Longer names may be folded, so that numbers stand beside them."""


@dataclass(frozen=True, slots=True)
class Row:
    """A row: its cells, whether it is bold, and whether a gap follows it."""

    cells: Sequence[str]
    bold: bool = False
    ends: bool = False


def show(names: Sequence[str], numbers: Sequence[str], rows: Sequence[Row], out: Console) -> None:
    """Print rows under the titles of their columns of words, then of numbers.

    Columns that the console has no room for stand in a table of their own below.
    """
    widths = _widths([*names, *numbers], rows)
    for part in _parts(len(names), widths, out.width):
        if part[0] > len(names):
            out.print()
        table = grid(names, [numbers[place - len(names)] for place in part])
        for row in rows:
            cells = [row.cells[place] for place in (*range(len(names)), *part)]
            style = "bold" if row.bold else None
            table.add_row(*cells, style=style, end_section=row.ends)
        out.print(table)


def grid(names: Sequence[str], numbers: Sequence[str]) -> Table:
    """Return an empty table with these columns of words, then of numbers."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    for name in names:
        table.add_column(name, overflow="fold")
    for number in numbers:
        table.add_column(number, justify="right", no_wrap=True)
    return table


def percent(fraction: float | None, digits: int = 2) -> str:
    """Return a fraction in percent, without the sign; an undefined one as a hyphen."""
    return _ascii(words.percent(fraction, digits))


def points(difference: float | None, digits: int = 2) -> str:
    """Return a difference of two fractions in percentage points, with its sign."""
    return _ascii(words.points(difference, digits))


def interval(low: float | None, high: float | None) -> str:
    """Return an interval of a difference in percentage points."""
    return _ascii(words.interval(low, high))


def marked(difference: Difference | Mapping[str, Any]) -> str:
    """Return the interval of a difference, with a mark where it stands after correction."""
    told = asdict(difference) if isinstance(difference, Difference) else difference
    stands_out = stands(told["p_holm"], told["confidence"])
    return f"{interval(told['low'], told['high'])} {MARK if stands_out else ' '}"


def _ascii(text: str) -> str:
    return text.replace(words.MINUS, "-").replace(words.DASH, "-")


def _widths(titles: Sequence[str], rows: Sequence[Row]) -> list[int]:
    """Return the places that each column takes up, with the gap after it."""
    from rich.cells import cell_len

    columns = zip(titles, *(row.cells for row in rows), strict=True)
    return [GAP + max(map(cell_len, column)) for column in columns]


def _parts(names: int, widths: Sequence[int], room: int) -> Iterator[list[int]]:
    """Part the columns of numbers into those that fit beside the names, one at least a part."""
    free = room + GAP - sum(min(width, GAP + LONGEST) for width in widths[:names])
    part: list[int] = []
    for place in range(names, len(widths)):
        if part and sum(widths[other] for other in (*part, place)) > free:
            yield part
            part = []
        part.append(place)
    yield part
