"""The outcome of a replay on one screen of 80 columns, in percent."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from roadeval.cli import console
from roadeval.cli.options import with_flags
from roadeval.cli.screens import tables
from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.data.words import BARS, counted, percent
from roadeval.evaluation.metrics import TESTED
from roadeval.recording.viewer import has_screen
from roadeval.report.blocks import Block, Text
from roadeval.report.sections import failures
from roadeval.report.sections.ground import distance_table, kitti_table
from roadeval.report.tables import cameras_table, differences_table, stages_table, thresholds_table
from roadeval.results.facts import Facts
from roadeval.results.sentences import account, correction
from roadeval.results.verdict import ROBUST, without_truth

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.run.replay import Outcome


def show(outcome: Outcome, out: Console) -> None:
    """Print what a replay read, each variant's rates, the outputs' paths, and the next commands."""
    facts = outcome.facts
    cameras = f"{counted(len(facts.cameras), 'camera')}, " if facts.cameras else ""
    out.print(f"{facts.drive.name}: {cameras}{account(facts.frames)}")
    if outcome.traffic:
        out.print(f"read {outcome.traffic}")
    out.print()
    if facts.totals:
        tables.show([*_score_tables(facts, outcome.metres)], out)
        out.print()
    if outcome.errors and out.encoding.startswith("utf"):
        label = f" up to {percent(max(outcome.errors), 1)} % ({facts.focus})"
        # Where several frames share a bar, it shows the highest error.
        size = -(-len(outcome.errors) // max(out.width - 11 - len(label), 1))
        starts = range(0, len(outcome.errors), size)
        errors = [max(outcome.errors[start : start + size]) for start in starts]
        bars = (BARS[int(error / (max(errors) or 1) * (len(BARS) - 1))] for error in errors)
        out.print(f"error      {''.join(bars)}{label}")
    if outcome.recording:
        recording = f"{outcome.recording} ({megabytes(outcome.recording)})"
        out.print(f"recording  {recording}", soft_wrap=True)
    if outcome.reports:
        count = len(outcome.files)
        out.print(f"results    {outcome.reports}{os.sep} ({count} files)", soft_wrap=True)
    if figures := [str(file) for file in outcome.files if file.suffix == ".png"]:
        line = f"figures    {' '.join(figures)}"
        out.print(console.wrap(line, out.width, indent=0, hang=11), soft_wrap=True)
    if place := outcome.recording or outcome.reports:
        console.show_next(out, *islice(_next_commands(outcome, place), 3))


def show_verdict(facts: Facts, out: Console) -> None:
    """Print the verdict; only losses follow it."""
    if facts.totals:
        tables.show_verdict(facts, out)
        return
    out.print()
    for sentence in facts.misfits:
        out.print(with_flags(sentence))
    why = "every frame with road truth was trained on or left out"
    if not facts.frames.labelled:
        why = "no frame that was read has road truth"
    out.print(f"Nothing to score: {why}.")
    for sentence in without_truth(facts.unlabelled):
        out.print(sentence)


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
    yield from failures.brief(facts)
    if metres:
        yield distance_table(metres, [*facts.finals], brief=True)
    if facts.kitti:
        yield kitti_table(facts)
    yield from failures.why(facts)


def _next_commands(outcome: Outcome, place: Path) -> Iterator[str]:
    """Yield the commands to type next, the most useful ones first.

    The second command depends on the result: it brings labels, compares two masks, or adds the
    preset for real roads to a weak result.
    """
    facts, path = outcome.facts, quote(str(place))
    yield f"roadeval report {path} -o {quote(place.with_suffix('.html').name)}"
    log = quote(facts.log.path) if facts.log else "DRIVE.mcap"
    config = path if outcome.recording else quote(str(place / "run.toml"))
    brought = [name for name in facts.finals if name not in (FILTERED, UNFILTERED, BASELINE)]
    masks = [*brought[:2], *(name for name in (FILTERED, UNFILTERED) if name in facts.finals)][:2]
    if facts.unlabelled and not facts.frames.labelled:
        yield f"roadeval pick {path if outcome.recording else log} -n 20 -o to_label"
    elif not facts.frames.labelled and facts.log is not None:
        yield f"roadeval replay {log} --truth LABELS"
    elif brought and len(masks) > 1:
        new, base = map(quote, masks)
        yield f"roadeval compare {path} --variant {base} --variant {new}"
    elif f"--variant {ROBUST}" in facts.verdict:
        name = f"{place.stem}_{ROBUST}"
        to = f"--save {quote(f'{name}.rrd')}" if outcome.recording else f"--reports {quote(name)}"
        yield f"roadeval replay {log} --config {config} --variant {ROBUST} {to}"
    if outcome.recording and has_screen():
        yield f"rerun {path}"
    if facts.totals or facts.unlabelled:
        yield f"roadeval inspect {path} --list"
    if outcome.recording and facts.totals:
        yield f"roadeval inspect {path} --worst 1 --screenshot worst.png"


def megabytes(file: Path) -> str:
    """Return a file's size in MB, or in kB if it is small."""
    size = file.stat().st_size
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{max(size / 1e3, 0.1):.1f} kB"
