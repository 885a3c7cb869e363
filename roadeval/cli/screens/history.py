"""A history on one screen of 80 columns."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from roadeval.cli.screens import tables
from roadeval.data.words import counted
from roadeval.evaluation.regions import ALL
from roadeval.report.blocks import BulletList
from roadeval.report.history import rates_table
from roadeval.results.history import History, describe_change, verdict

EVENTS: Final = 8
"""Greatest number of changes that are shown, the newest ones."""

if TYPE_CHECKING:
    from rich.console import Console


def show(history: History, out: Console) -> None:
    """Print the rates over the runs, the steps, and the verdict last."""
    runs = history.runs
    about = f"{runs[0].title} to {runs[-1].title}, {counted(runs[-1].drives, 'drive')} in the last"
    out.print(f"{counted(len(runs), 'run')}, {about}")
    out.print()
    rates = rates_table([line for line in history.lines if line.kind == ALL])
    if not out.encoding.startswith("utf"):  # no bars
        rows = [row[:-1] for row in rates.rows]
        rates = replace(rates, columns=rates.columns[:-1], rows=rows, text_columns=(0, 1))
    events = [
        f"{runs[event.run].name}: {describe_change(event.first)}. There: {'; '.join(event.reasons)}"
        for event in history.events[-EVENTS:]
    ]
    tables.show([rates, *([BulletList("Changes", events[::-1])] if events else [])], out)
    out.print()
    out.print(verdict(history), style="bold")
