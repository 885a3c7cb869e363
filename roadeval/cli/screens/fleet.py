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
"""Drives that the table of drives shows."""
NAMED: Final = 5
"""Drives that failed for one reason, which are named."""


def show(outcome: FleetOutcome, out: Console) -> None:
    """Print how many drives there are, the verdict, the rates, and the effects over drives."""
    facts = outcome.facts
    total = sum(outcome.counts.values())
    out.print(drives_account(outcome.counts, facts.frames))
    if 0 < outcome.replayed < total:
        out.print(f"{total - outcome.replayed} of them were done before.")
    elif not outcome.replayed:
        out.print("All of it was done before.")
    out.print()
    out.print(with_flags(facts.verdict))
    out.print()
    if facts.totals:
        blocks = [rates_table(facts), *([differences_table(facts)] if facts.effects else [])]
        worst = drives_table(FleetFolder(outcome.folder), WORST)
        tables.show([*blocks, Heading("Drives with the highest ERR"), worst], out)
        out.print()
    out.print(f"results    {outcome.folder}{os.sep}", soft_wrap=True)
    listed = [f"roadeval inspect {outcome.folder} --list"] if facts.totals else []
    console.show_next(out, *listed, f"roadeval report {outcome.folder}")


def problems(outcome: FleetOutcome) -> Iterator[str]:
    """Yield what to know first, and why drives failed, with the first drives of each reason."""
    yield from outcome.facts.warnings
    fleet = FleetFolder(outcome.folder)
    failed = fleet.drives.loc[[*outcome.problems]]
    for reason, drives in by_reason(fleet, failed).items():
        yield f"{first_of(drives, NAMED)}: {reason}"
