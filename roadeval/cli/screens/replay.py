"""The outcome of a replay on one screen of 80 columns, in percent."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from roadeval.cli import console
from roadeval.cli.options import with_flags
from roadeval.cli.screens import tables
from roadeval.data.words import counted
from roadeval.evaluation.metrics import TESTED
from roadeval.recording.viewer import has_screen
from roadeval.report.blocks import Block, Text
from roadeval.report.sections.ground import distance_table
from roadeval.report.tables import cameras_table, differences_table, stages_table, thresholds_table
from roadeval.results.facts import Facts
from roadeval.results.sentences import account, correction
from roadeval.results.verdict import without_truth

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.run.replay import Outcome


def show(outcome: Outcome, out: Console) -> None:
    """Print what a replay read, each variant's rates, the outputs' places, and last the verdict."""
    facts = outcome.facts
    cameras = f"{counted(len(facts.cameras), 'camera')}, " if facts.cameras else ""
    out.print(f"{facts.drive.name}: {cameras}{account(facts.frames, facts.windows)}")
    out.print()
    if facts.totals:
        tables.show([*_score_tables(facts, outcome.metres)], out)
    else:
        for sentence in facts.misfits:
            out.print(with_flags(sentence))
        why = "every frame with road truth was trained on or left out"
        if not facts.frames.labelled:
            why = "no frame that was read has road truth"
        out.print(f"Nothing to score: {why}.")
        for sentence in without_truth(facts.unlabelled):
            out.print(sentence)
    out.print()
    _show_files(outcome, out)
    if facts.totals:
        out.print()
        tables.show([Text(with_flags(facts.verdict))], out)


def _score_tables(facts: Facts, metres: Sequence[Mapping[str, Any]]) -> Iterator[Block]:
    """Yield the tables of a replay that scored frames."""
    yield stages_table(facts.totals)
    if facts.cameras:
        yield cameras_table(facts)
    if pairs := facts.final_effects:
        yield differences_table(facts, brief=True)
        if legend := correction(pair.rates[TESTED] for pair in pairs):
            yield Text(legend)
    if facts.curves:
        yield thresholds_table(facts.curves, facts.totals)
    if metres:
        yield distance_table(metres, [*facts.finals], brief=True)


def _show_files(outcome: Outcome, out: Console) -> None:
    """Print the paths of the outputs on one line each, to copy, and what to type next."""
    if outcome.recording:
        size = megabytes(outcome.recording)
        out.print(f"recording  {outcome.recording} ({size})", soft_wrap=True)
    if outcome.reports:
        count = len(outcome.files)
        out.print(f"results    {outcome.reports}{os.sep} ({count} files)", soft_wrap=True)
    if place := outcome.recording or outcome.reports:
        console.show_next(out, *_next_commands(outcome, place))


def _next_commands(outcome: Outcome, place: Path) -> Iterator[str]:
    """Yield the commands to type next."""
    scored, log = bool(outcome.facts.totals), outcome.facts.log
    if outcome.recording and has_screen():
        yield f"rerun {place}"
    elif outcome.recording and scored:
        yield f"roadeval inspect {place} --worst 1 --screenshot worst.png"
    if scored or outcome.facts.unlabelled:
        yield f"roadeval inspect {place} --list"
    elif not outcome.facts.frames.labelled and log is not None:
        yield f"roadeval replay {log.path} --truth LABELS"
    yield f"roadeval report {place}"


def megabytes(file: Path) -> str:
    """Return a file's size in MB, or in kB if it is small."""
    size = file.stat().st_size
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{max(size / 1e3, 0.1):.1f} kB"
