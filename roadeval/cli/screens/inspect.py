"""The worst frames on one screen of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from roadeval.cli.screens.tables import ascii_of, show_table
from roadeval.data.words import percent, points
from roadeval.evaluation.metrics import SHORT
from roadeval.report.blocks import Table

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.inspect import WorstFrame


def show(drive: str, found: Sequence[WorstFrame], out: Console) -> None:
    """Print a drive's worst frames: their rates, where ERR comes from, and the notes on them."""
    mask = f"{found[0].variant} by ERR of {found[0].stage}"
    out.print(f"{drive}: worst frames of {mask} (of neighbours only the worst)")
    out.print()
    titles = ["", "frame", *(f"{rate} %" for rate in SHORT), "why"]
    rows = [
        [str(each.rank), str(each.frame), *(percent(each.rates[r]) for r in SHORT), _why(each)]
        for each in found
    ]
    why = [len(titles) - 1]
    show_table(Table(titles, rows, text_columns=why, breaks=range(1, len(rows))), out)


def _why(frame: WorstFrame) -> str:
    (first, value), *rest = frame.parts.items()
    terms = [f"{first} {percent(value, 1)}", *(f"{name} {points(part, 1)}" for name, part in rest)]
    return " ".join([f"{ascii_of(', '.join(terms))} pp.", *frame.notes])
