"""The worst frames of a fleet on one screen of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from roadeval.cli.screens import tables
from roadeval.data.words import percent
from roadeval.report.blocks import Table

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.fleet_inspect import FleetFrame

LIGHT: Final = {"luminance": "bright %", "shadow": "shade %", "sun": "sun"}
"""What is shown of the light, and the titles."""


def show(fleet: str, found: Sequence[FleetFrame], out: Console) -> None:
    """Print the worst frames of all drives: their rates, their light, and what can be opened."""
    mask = f"{found[0].variant} by ERR of {found[0].stage}"
    out.print(f"{fleet}: worst frames of {mask} (of a drive's neighbours only the worst)")
    out.print()
    rates = list(found[0].rates)
    titles = (*(f"{rate} %" for rate in rates), *LIGHT.values(), "kept")
    rows = [
        [
            str(each.rank),
            each.drive,
            str(each.frame),
            *(percent(each.rates[rate]) for rate in rates),
            *(percent(each.light[name], 0) for name in ("luminance", "shadow")),
            _sun(each.light["sun"]),
            "yes" if each.recording else "-",
        ]
        for each in found
    ]
    tables.show_table(Table(["", "drive", "frame", *titles], rows, text_columns=(0, 1)), out)
    if not all(each.recording for each in found):
        out.print()
        out.print("Where no recording was kept, --worst K --trust-sources replays the drive first.")


def _sun(measured: float | None) -> str:
    return "-" if measured is None else f"{measured:+.2f}"
