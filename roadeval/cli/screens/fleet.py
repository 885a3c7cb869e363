"""The outcome of a fleet on one screen of 80 columns."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from roadeval.cli import console
from roadeval.cli.screens import tables
from roadeval.data.words import counted, first_of, interval, percent, points
from roadeval.evaluation.metrics import FULL
from roadeval.evaluation.regions import ALL
from roadeval.evaluation.score import TESTED
from roadeval.report.blocks import Table
from roadeval.results.facts import OverDrives
from roadeval.results.fleet import FleetFolder
from roadeval.results.schema import DAMAGED, FAILED, SCORED, UNSCORED

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.run.fleet import FleetOutcome

RATES: Final = {"ERR": "ERR %", "pooled_ERR": "pooled ERR %"} | {n: f"{n} %" for n in FULL}
STATUSES: Final = {
    SCORED: "scored",
    DAMAGED: "scored but for what is lost",
    UNSCORED: "without truth",
    FAILED: "failed",
}
WORST: Final = 12
"""Drives that the table of drives shows."""
NAMED: Final = 5
"""Drives that failed for one reason, which are named."""


def show(outcome: FleetOutcome, out: Console) -> None:
    """Print how many drives there are, the verdict, the rates, and the effects over drives."""
    facts = outcome.facts
    states = (
        f"{outcome.counts[s]} {text}" for s, text in STATUSES.items() if outcome.counts.get(s)
    )
    total = sum(outcome.counts.values())
    out.print(f"{counted(total, 'drive')}: {', '.join(states)}; {facts.frames} frames evaluated")
    if 0 < outcome.replayed < total:
        out.print(f"{total - outcome.replayed} of them were done before.")
    elif not outcome.replayed:
        out.print("All of it was done before.")
    out.print()
    out.print(facts.verdict)
    out.print()
    if facts.rates:
        show_rates(facts.rates, out)
        out.print()
    if facts.effects:
        show_effects(facts.effects, out)
        out.print()
    if facts.rates:
        show_drives(FleetFolder(outcome.folder), list(facts.rates), out)
        out.print()
    out.print(f"results    {outcome.folder}{os.sep}", soft_wrap=True)
    listed = [f"roadeval inspect {outcome.folder} --list"] if facts.rates else []
    console.show_next(out, *listed, f"roadeval report {outcome.folder}")


def show_rates(rates: Sequence[Mapping[str, Any]], out: Console) -> None:
    """Print the rates of the final masks: the drives' means."""
    rows = [
        [row["variant"], str(row["drives"]), *(percent(row[rate]) for rate in RATES)]
        for row in rates
    ]
    caption = "Final masks: the mean of the drives' mean rates"
    tables.show_table(Table(["variant", "drives", *RATES.values()], rows, caption=caption), out)


def show_drives(folder: FleetFolder, rates: Sequence[Mapping[str, Any]], out: Console) -> None:
    """Print the drives on which the first variant has the highest error rates."""
    import pyarrow.compute as pc

    variants = [row["variant"] for row in rates]
    final = (pc.field("region") == ALL) & pc.field("final")
    errors: dict[str, dict[str, float | None]] = {}
    for row in folder.table("scores").filter(final).to_pylist():
        errors.setdefault(row["drive"], {})[row["variant"]] = row[TESTED]
    first = variants[0]
    worst = sorted(errors, key=lambda name: (-(errors[name].get(first) or 0.0), name))
    rows = [
        [
            folder.names[name],
            str(folder.drives[name]["evaluated"]),
            *(percent(errors[name].get(each)) for each in variants),
        ]
        for name in worst[:WORST]
    ]
    caption = f"Final masks, ERR %: the drives, {first}'s worst first"
    if len(worst) > WORST:
        caption += f" ({WORST} of {len(worst)}; all are in drives.parquet and scores.parquet)"
    tables.show_table(Table(["drive", "frames", *variants], rows, (0,), caption=caption), out)


def show_effects(effects: Sequence[OverDrives], out: Console) -> None:
    """Print the differences of ERR over drives."""
    tested = [each for each in effects if each.metric == TESTED]
    (confidence,) = {each.confidence for each in tested}
    rows = [
        [
            f"{each.variant} - {each.base}",
            points(each.mean),
            interval(each.low, each.high),
            *("-" if count is None else str(count) for count in (each.worse, each.better)),
            points(each.pooled),
        ]
        for each in tested
    ]
    titles = ["variants", "mean", "interval", "worse", "better", "pooled"]
    caption = f"Change of ERR in percentage points, over drives ({confidence:.0%} interval)"
    tables.show_table(Table(titles, rows, caption=caption), out)


def problems(outcome: FleetOutcome) -> Iterator[str]:
    """Yield what to know first, and why drives failed, with the first drives of each reason."""
    for path in outcome.unused:
        yield f"the settings for {path} hold for none of these drives"
    yield from outcome.facts.warnings
    for condition in outcome.facts.conditions:
        if condition.judged and (missing := [*condition.not_judged.values()]):
            more = f" (and {len(missing) - 1} more drives)" if missing[1:] else ""
            yield f"{condition.condition}: {missing[0]}{more}"
    reasons: dict[str, list[str]] = {}
    names = FleetFolder(outcome.folder).names
    for drive, text in outcome.problems.items():
        reasons.setdefault(_reason(drive, text, outcome), []).append(names[drive])
    for reason, drives in reasons.items():
        yield f"{first_of(drives, NAMED)}: {reason}"


def _reason(drive: str, text: str, outcome: FleetOutcome) -> str:
    """Return a reason without the name of the drive's file, which begins most of them."""
    sources = {each.drive: each.source for each in outcome.facts.drives}
    source = sources.get(drive, "")
    for name in (source, source.rpartition("/")[2]):
        text = text.removeprefix(f"{name}: ") if name else text
    return text
