"""What is quoted of a replay's curves over thresholds, in percent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from roadeval.cli.screens import tables
from roadeval.data.words import percent
from roadeval.report.blocks import Table

if TYPE_CHECKING:
    from rich.console import Console

COLUMNS: Final = {
    "AP": "AP %",
    "AUC": "AUC %",
    "MaxF": "MaxF %",
    "threshold": "at %",
    "ECE": "ECE %",
}
"""Of ``curves`` in ``summary.json``, with the titles of their columns."""


def show(curves: Mapping[str, Mapping[str, Mapping[str, Any]]], out: Console) -> None:
    """Print a row for each variant and stage that says how probable road is."""
    rows = [
        [variant, stage, *(percent(own[name]) for name in COLUMNS)]
        for variant, stages in curves.items()
        for stage, own in stages.items()
    ]
    titles = ["over thresholds", "stage", *COLUMNS.values()]
    tables.show_table(Table(titles, rows, text_columns=(0, 1)), out)
