"""The outcome of a fleet on one screen of 80 columns."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from shlex import quote
from typing import TYPE_CHECKING, Final

from roadeval.cli import console
from roadeval.cli.options import FLAGS
from roadeval.cli.screens import tables
from roadeval.data.words import first_of
from roadeval.report.blocks import Block, Heading
from roadeval.report.sections import failures
from roadeval.report.sections.drives import by_reason, drives_account, drives_table
from roadeval.report.tables import differences_table, rates_table
from roadeval.results.fleet import FleetFolder

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.run.fleet import FleetOutcome
    from roadeval.results.facts import FleetFacts

WORST: Final = 12
"""Greatest number of drives in the table of drives."""
NAMED: Final = 5
"""Greatest number of drives that are named for one reason, or listed in a manifest."""


def show(outcome: FleetOutcome, out: Console) -> None:
    """Print how many drives there are, the rates, the effects over drives, what to do next."""
    facts = outcome.facts
    earlier = sum(outcome.counts.values()) - outcome.replayed
    out.print(drives_account(outcome.counts, facts.frames))
    if not outcome.replayed:
        out.print("All drives were done before.")
    elif earlier > 0:
        out.print(f"{earlier} of them were done before.")
    out.print()
    if facts.totals:
        blocks: list[Block] = [rates_table(facts)]
        blocks += [differences_table(facts, brief=True)] if facts.effects else []
        blocks += failures.brief(facts)
        blocks += failures.why(facts)
        worst = drives_table(FleetFolder(outcome.folder), WORST)
        tables.show([*blocks, Heading(f"Drives with the highest ERR of {facts.focus}"), worst], out)
        out.print()
    folder = str(console.from_here(outcome.folder))
    out.print(f"results    {folder}{os.sep}", soft_wrap=True)
    folder = quote(folder)
    page = f"roadeval report {folder} -o {quote(f'{outcome.folder.name}.html')}"
    console.show_next(out, page, *([f"roadeval inspect {folder} --list"] if facts.totals else []))


def problems(outcome: FleetOutcome) -> Iterator[str]:
    """Yield the warnings, and a sentence for each reason of failure with the first drives."""
    yield from outcome.facts.warnings
    fleet = FleetFolder(outcome.folder)
    failed = fleet.drives.loc[[*outcome.problems]]
    for reason, drives in by_reason(fleet, failed).items():
        sentence = re.sub(r"`([\w.]+)`", lambda setting: FLAGS.get(setting[1], setting[0]), reason)
        yield f"{first_of(drives, NAMED)}: {sentence}"


def manifest(facts: FleetFacts) -> Iterator[str]:
    """Yield the lines of a manifest to copy, if drives failed because their labels differ.

    The labels of the command belong to the drives that did not fail because of labels.
    """
    odd = {drive for drive, reason in facts.failed.items() if "`labels." in reason}
    named = {key: value for key, value in facts.run["labels"].items() if value}
    labels = ", ".join(f"{key} = {json.dumps(value)}" for key, value in named.items())
    for drive in facts.drives[:NAMED] if odd and len(facts.drives) > 1 else ():
        yield from ("", "[[drives]]", f"path = {json.dumps(drive.source)}")
        if bool(labels) != (drive.drive in odd):
            yield f"labels = {{ {labels or 'road = [1]'} }}"
