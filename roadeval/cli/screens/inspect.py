"""The worst frames on one screen of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from roadeval.cli.screens.tables import grid, percent, points
from roadeval.evaluation.metrics import SHORT

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.inspect import WorstFrame


def show(drive: str, found: Sequence[WorstFrame], out: Console) -> None:
    """Print a drive's worst frames: their rates, where ERR comes from, and the notes on them."""
    mask = f"{found[0].variant} by ERR of {found[0].stage}"
    out.print(f"{drive}: worst frames of {mask} (of neighbours only the worst)")
    out.print()
    table = grid((), ("", "frame", *(f"{rate} %" for rate in SHORT)))
    table.add_column("why", overflow="fold")
    for each in found:
        rates = (percent(each.rates[rate]) for rate in SHORT)
        table.add_row(str(each.rank), str(each.frame), *rates, _why(each), end_section=True)
    out.print(table)


def _why(frame: WorstFrame) -> str:
    (first, value), *rest = frame.parts.items()
    terms = [f"{first} {percent(value, 1)}", *(f"{name} {points(part, 1)}" for name, part in rest)]
    return " ".join([f"{', '.join(terms)} pp.", *frame.notes])
