"""The outcome of a fleet on one screen of 80 columns."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from roadeval.cli import console
from roadeval.cli.options import with_flags
from roadeval.cli.screens import tables
from roadeval.data.words import first_of
from roadeval.report.blocks import Heading
from roadeval.report.sections.drives import by_reason, drives_table
from roadeval.report.sections.summary import drives_account
from roadeval.report.tables import differences_table, rates_table
from roadeval.results.fleet import FleetFolder

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.run.fleet import FleetOutcome

WORST: Final = 12
"""Drives in the table of drives."""
NAMED: Final = 5
"""Drives that are named for each reason of failure."""


def show(outcome: FleetOutcome, out: Console) -> None:
    """Print how many drives there are, the verdict, the rates, and the effects over drives."""
    facts = outcome.facts
    earlier = sum(outcome.counts.values()) - outcome.replayed
    out.print(drives_account(outcome.counts, facts.frames))
    if not outcome.replayed:
        out.print("All of it was done before.")
    elif earlier > 0:
        out.print(f"{earlier} of them were done before.")
    out.print()
    out.print(with_flags(facts.verdict))
    out.print()
    if facts.totals:
        blocks = [rates_table(facts), *([differences_table(facts)] if facts.effects else [])]
        worst = drives_table(FleetFolder(outcome.folder), WORST)
        tables.show([*blocks, Heading("Drives with the highest ERR"), worst], out)
        out.print()
    out.print(f"results    {outcome.folder}{os.sep}", soft_wrap=True)
    inspect = [f"roadeval inspect {outcome.folder} --list"] if facts.totals else []
    console.show_next(out, *inspect, f"roadeval report {outcome.folder}")


def problems(outcome: FleetOutcome) -> Iterator[str]:
    """Yield the warnings, and why drives failed, with the first drives of each reason."""
    yield from outcome.facts.warnings
    fleet = FleetFolder(outcome.folder)
    failed = fleet.drives.loc[[*outcome.problems]]
    for reason, drives in by_reason(fleet, failed).items():
        yield f"{first_of(drives, NAMED)}: {reason}"
