"""The outcome of a replay on one screen of 80 columns, in percent."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.cli import console
from roadeval.data import BASELINE, FILTERED, FINAL_STAGE, UNFILTERED
from roadeval.data.words import defined

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from roadeval.jobs.replay import Outcome

RATES: Final = ("ERR", "pooled_ERR", "ACC", "FPR", "FNR")
COMPARED: Final = ("ERR", "FPR", "FNR")

Totals = Mapping[str, Mapping[str, Mapping[str, Any]]]
"""Counts and rates by variant and stage, as ``totals`` in ``summary.json``."""


def show(outcome: Outcome, out: Console) -> None:
    """Print what a replay read, how well each variant did, and where everything was written."""
    summary = outcome.summary
    out.print(f"{summary['drive']['name']}: {accounting(summary)}")
    out.print()
    if summary["totals"]:
        _show_scores(summary, out)
    else:
        out.print(f"Nothing to score: {_why_nothing(summary['frames'])}.")
    out.print()
    _show_files(outcome, out)


def accounting(summary: Mapping[str, Any]) -> str:
    """Return the account of the frames in a line."""
    frames = summary["frames"]
    counted = f"{frames['evaluated'] or 'none'} evaluated"
    if summary["windows"]:
        counted += f" in {summary['windows']} windows"
    skipped = (f"{number} {why}" for why, number in frames["skipped"].items())
    of = f" of {frames['in_log']}" if frames["read"] < frames["in_log"] else ""
    return ", ".join([f"{frames['read']}{of} frames read", *skipped, counted])


def _show_scores(summary: Mapping[str, Any], out: Console) -> None:
    out.print(scores(summary["totals"]))
    out.print()
    out.print(best(summary["totals"]))
    if final := summary["difference"].get(FINAL_STAGE):
        out.print(f"{FILTERED} minus {UNFILTERED}, {FINAL_STAGE}:")
        out.print(differences(final))
    out.print(summary["verdict"])


def _why_nothing(frames: Mapping[str, Any]) -> str:
    if frames["labelled"]:
        return "every frame with road truth was trained on or left out"
    return "no frame that was read has road truth"


def scores(totals: Totals) -> Table:
    """Tabulate the rates by variant and stage; the lowest ERR of a final mask is bold."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    table.add_column("variant", overflow="fold")
    table.add_column("stage", overflow="fold")
    for name in ("frames", "ERR", "pooled ERR", "ACC", "FPR", "FNR"):
        table.add_column(name, justify="right")
    winner = _lowest(totals)
    for variant, stages in totals.items():
        for place, (stage, total) in enumerate(stages.items()):
            table.add_row(
                "" if place else variant,
                stage,
                str(total["frames"]),
                *(percent(total[name]) for name in RATES),
                style="bold" if (variant, stage) == (winner, FINAL_STAGE) else None,
                end_section=place == len(stages) - 1,
            )
    return table


def best(totals: Totals) -> str:
    """Name the variant whose final mask has the lowest mean ERR, the baseline not excepted."""
    winner = _lowest(totals)
    if winner is None:
        return "ERR is defined on no frame."
    aside = ", which never looks at the image" if winner == BASELINE else ""
    return f"Lowest ERR: {winner}{aside}, {percent(totals[winner][FINAL_STAGE]['ERR'])}"


def differences(final: Mapping[str, Mapping[str, Any]]) -> Table:
    """Tabulate what the filter changed in the final mask: percentage points, and how sure."""
    from rich.table import Table

    table = Table.grid(padding=(0, 2, 0, 0))
    for rate in COMPARED:
        if rate in final:
            table.add_row(f"  {rate}", points(final[rate]["mean"]), _certainty(final[rate]))
    return table


def percent(fraction: float | None) -> str:
    """Return a rate for the terminal, in ASCII alone; an undefined one as a dash."""
    return f"{100 * fraction:.2f} %" if defined(fraction) else "-"


def points(fraction: float | None) -> str:
    """Return a difference of two rates in percentage points, with its sign, in ASCII alone."""
    return f"{100 * fraction:+.2f} pp" if defined(fraction) else "-"


def _show_files(outcome: Outcome, out: Console) -> None:
    """Print where the outputs lie; a path is never broken, so that it can be copied."""
    if outcome.recording:
        out.print(f"recording  {outcome.recording} ({size(outcome.recording)})", soft_wrap=True)
    if outcome.reports:
        names = ", ".join(file.name for file in outcome.files)
        out.print(f"results    {outcome.reports}{os.sep}", soft_wrap=True)
        out.print(console.wrapped(names, out.width, indent=11), soft_wrap=True)


def size(file: Path) -> str:
    """Write a file's size for a person."""
    bytes_ = file.stat().st_size
    return f"{bytes_ / 1e6:.1f} MB" if bytes_ >= 1e6 else f"{max(bytes_ / 1e3, 0.1):.1f} kB"


def _certainty(difference: Mapping[str, Any]) -> str:
    if not defined(difference["low"]):
        return f"no interval: {difference['reason']}"
    low, high = (points(difference[end]) for end in ("low", "high"))
    return f"{100 * difference['confidence']:.0f} % interval {low} to {high}"


def _lowest(totals: Totals) -> str | None:
    errors = {
        variant: stages[FINAL_STAGE]["ERR"]
        for variant, stages in totals.items()
        if defined(stages.get(FINAL_STAGE, {}).get("ERR"))
    }
    return min(errors, key=errors.__getitem__, default=None)
