"""Blocks of a report on a terminal; numbers are ASCII, whatever the terminal's encoding."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Final, Literal

from roadeval.cli.options import with_flags
from roadeval.data import BASELINE, words
from roadeval.evaluation.metrics import TESTED
from roadeval.report.blocks import Block, BulletList, Cell, Heading, Table, Text, plain
from roadeval.results.facts import Facts, FleetFacts
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from rich.console import Console

GAP: Final = 2
"""Spaces between columns."""
LONGEST: Final = 20
"""Longer names, in letters, may be folded to leave room for numbers beside them."""


def show(blocks: Iterable[Block], out: Console) -> None:
    """Print headings, texts, lists and tables, with an empty line between them."""
    for number, block in enumerate(blocks):
        if number:
            out.print()
        match block:
            case Heading() | Text():
                out.print(block.text)
            case BulletList():
                out.print(f"{block.title}:")
                for item in block.items:
                    out.print(f"- {plain(item)}")
            case Table():
                show_table(block, out)
            case _:
                raise NotImplementedError(f"a terminal shows no {block.kind}")


def show_verdict(facts: Facts | FleetFacts, out: Console) -> None:
    """Print a verdict: green if its focus is better than the baseline, red if not.

    It is yellow if truth, masks and images do not fit.
    """
    focus, style = facts.focus, "bold"
    for effect in facts.final_effects:
        if (effect.base, effect.variant) == (BASELINE, focus) and effect.rates[TESTED].units:
            style = "bold green" if effect.rates[TESTED].mean < 0 else "bold red"
    if isinstance(facts, Facts) and facts.misfits:
        style = "bold yellow"
    out.print()
    out.print(ascii_of(with_flags(facts.verdict)), style=style)


def show_table(table: Table, out: Console) -> None:
    """Print a table.

    If the table is too wide for the console, each word of a heading has a line of its own. Columns
    of numbers that still do not fit are printed below, with the names again.
    """
    from rich import box
    from rich.table import Table as Grid
    from rich.text import Text as Line

    if table.caption:
        out.print(ascii_of(table.caption))
    columns = []
    for place in range(len(table.columns)):
        texts = [plain(row[place]).replace(f" {words.MINUS} ", " - ") for row in table.rows]
        columns.append(texts if place in table.text_columns else [*map(ascii_of, texts)])
    titles = [*map(ascii_of, map(visible, table.columns))]
    if len([*_parts(table, titles, columns, out.width)]) > 1:
        height = max(title.count(" ") for title in titles)
        titles = ["\n" * (height - title.count(" ")) + title.replace(" ", "\n") for title in titles]
    for number, part in enumerate(_parts(table, titles, columns, out.width)):
        if number:
            out.print()
        grid = Grid(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
        for place in part:
            is_text = place in table.text_columns
            justify: Literal["left", "right"] = "left" if is_text else "right"
            title = Line(titles[place])
            grid.add_column(title, justify=justify, no_wrap=not is_text, overflow="fold")
        for line, row in enumerate(table.rows):
            cells = {place: out.render_str(columns[place][line]) for place in part}
            for place, text in cells.items():
                if isinstance(cell := row[place], Cell) and cell.bold:
                    text.stylize("bold")
            grid.add_row(*cells.values(), end_section=line + 1 in table.breaks)
        out.print(grid)


def ascii_of(number: str) -> str:
    """Return a number of `roadeval.data.words` with ASCII signs for minus, dash and about."""
    signs = f"{words.MINUS}{words.DASH}\N{ALMOST EQUAL TO}"
    return number.translate(str.maketrans(signs, "--~"))


def _parts(
    table: Table, titles: Sequence[str], columns: Sequence[Sequence[str]], room: int
) -> Iterator[list[int]]:
    """Yield the positions of the columns of each part of a table that fits into ``room`` letters.

    Each part has all columns of names. There are as few parts as possible, of about equal size.
    """
    from rich.cells import cell_len

    titled = zip(titles, columns, strict=True)
    widths = [GAP + max(map(cell_len, [*title.split("\n"), *texts])) for title, texts in titled]
    names = [*table.text_columns]
    free = room + GAP - sum(min(widths[place], GAP + LONGEST) for place in names)
    parts: list[list[int]] = [[]]
    numbers = [place for place in range(len(widths)) if place not in names]
    for place in numbers:
        if parts[-1] and sum(widths[other] for other in (*parts[-1], place)) > free:
            parts.append([])
        parts[-1].append(place)
    size = max(-(-len(numbers) // len(parts)), 1)
    even = [numbers[begin : begin + size] for begin in range(0, len(numbers), size)]
    if all(sum(widths[place] for place in part) <= free for part in even):
        parts = even or parts
    yield from (sorted(names + part) for part in parts)
