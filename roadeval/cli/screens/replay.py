"""The outcome of a replay on one screen of 80 columns, in percent."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from roadeval.cli import console
from roadeval.cli.screens import tables
from roadeval.data import FILTERED, FINAL_STAGE, UNFILTERED
from roadeval.data.words import counted, interval, percent, points, short_names
from roadeval.evaluation.metres import ABOVE
from roadeval.evaluation.metrics import FULL, SHORT
from roadeval.evaluation.score import Measured
from roadeval.evaluation.stats import Difference
from roadeval.recording.viewer import has_screen
from roadeval.report.blocks import Cell, Table, Text
from roadeval.results.facts import Facts, FrameAccount, Totals
from roadeval.results.sentences import (
    account,
    correction,
    lowest,
    marked_interval,
    of_seeds,
    seeds_in_words,
    spread,
    without_truth,
)

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.run.replay import Outcome

RATES: Final = {"ERR": "ERR %", "pooled_ERR": "pooled ERR %"} | {n: f"{n} %" for n in FULL}
"""The rates of every stage, with the titles of their columns."""
CURVES: Final = {n: f"{n} %" for n in ("AP", "AUC", "MaxF")} | {"threshold": "at %", "ECE": "ECE %"}
"""What is quoted of curves over thresholds, with the titles of their columns."""
OTHERS: Final = tuple(rate for rate in SHORT if rate != "ERR")
"""The rates whose differences stand beside that of ERR."""


def show(outcome: Outcome, out: Console) -> None:
    """Print what a replay read, how well each variant did, and where everything was written."""
    facts = outcome.facts
    of = f"{counted(len(facts.cameras), 'camera')}, " if facts.cameras else ""
    out.print(f"{facts.drive.name}: {of}{account(facts.frames, facts.windows)}")
    out.print()
    if facts.totals:
        out.print(facts.verdict)
        out.print()
        _show_scores(facts, out)
        if outcome.metres:
            out.print()
            tables.show_table(by_distance(outcome.metres), out)
    else:
        out.print(f"Nothing to score: {_why_nothing(facts.frames)}.")
        for sentence in without_truth(facts.unlabelled):
            out.print(sentence)
    out.print()
    _show_files(outcome, out)


def _show_scores(facts: Facts, out: Console) -> None:
    tables.show_table(scores(facts.totals), out)
    if facts.cameras:
        out.print()
        tables.show_table(cameras(facts), out)
    repeats = facts.seeds
    if pairs := dict(_pairs(facts)):
        out.print()
        tables.show_table(differences(pairs), out)
        if legend := correction(by_rate["ERR"] for by_rate in pairs.values()):
            out.print(legend)
        for rate, values in repeats.get("difference", {}).get(FINAL_STAGE, {}).items():
            if found := spread(values):
                ends = f"{seeds_in_words(repeats)}: {tables.ascii_of(interval(*found[1:]))}"
                out.print(f"{FILTERED} - {UNFILTERED}, {rate}, pp, {ends}")
    if repeats:
        out.print()
        from roadeval.report.sections.summary import seeds_table

        tables.show([seeds_table(repeats, [*facts.totals]), Text(of_seeds(repeats))], out)
    if curves := facts.curves:
        out.print()
        tables.show_table(over_thresholds(curves), out)


def _why_nothing(frames: FrameAccount) -> str:
    if frames.labelled:
        return "every frame with road truth was trained on or left out"
    return "no frame that was read has road truth"


def scores(totals: Totals) -> Table:
    """Tabulate the rates of each variant and stage; the best final mask's are bold."""
    winner = lowest({name: own[FINAL_STAGE] for name, own in totals.items() if FINAL_STAGE in own})
    rows: list[list[Cell]] = []
    breaks = []
    for variant, stages in totals.items():
        breaks.append(len(rows))
        for place, (stage, total) in enumerate(stages.items()):
            texts = ["" if place else variant, stage, str(total["frames"])]
            texts += [percent(total.get(name)) for name in RATES]
            best = (variant, stage) == (winner, FINAL_STAGE)
            rows.append([Cell(text, bold=best) for text in texts])
    titles = ["variant", "stage", "frames", *RATES.values()]
    return Table(titles, rows, text_columns=(0, 1), breaks=breaks)


def by_distance(metres: Sequence[Measured]) -> Table:
    """Tabulate ERR of final masks by distance ahead, and by area of the ground seen from above."""
    errors = [each for each in metres if each.measure == "ERR"]
    found = {(each.variant, each.where): each.value for each in errors}
    places = list(dict.fromkeys(each.where for each in errors))
    rows = [
        [variant, *(percent(found[variant, place]) for place in places)]
        for variant in dict.fromkeys(each.variant for each in errors)
    ]
    heads = ["by area" if place == ABOVE else place for place in places]
    return Table(["ERR %, on the ground", *heads], rows)


def over_thresholds(curves: Totals) -> Table:
    """Tabulate what is quoted of curves, of each variant and stage that says how probable road is.

    In percent.
    """
    rows = [
        [variant, stage, *(percent(own[name]) for name in CURVES)]
        for variant, stages in curves.items()
        for stage, own in stages.items()
    ]
    return Table(["over thresholds", "stage", *CURVES.values()], rows, text_columns=(0, 1))


def cameras(facts: Facts) -> Table:
    """Tabulate ERR of each camera's final masks."""
    names, masks = short_names([*facts.cameras]), [*facts.finals]
    rows = []
    for camera, own in facts.cameras.items():
        errors = {name: own.totals[name][stage]["ERR"] for name, stage in own.finals.items()}
        cells = [percent(errors.get(name)) for name in masks]
        rows.append([names[camera], str(own.frames.evaluated), *cells])
    return Table(["camera", "frames", *(f"{name} ERR %" for name in masks)], rows)


def _pairs(facts: Facts) -> Iterator[tuple[str, Mapping[str, Difference]]]:
    """Yield what is subtracted from what, of final masks, and the differences."""
    for each in facts.effects:
        if each.final:
            yield f"{each.variant} - {each.base}", each.rates


def differences(pairs: Mapping[str, Mapping[str, Difference]]) -> Table:
    """Tabulate for each pair the difference of ERR with its interval, and those of others."""
    confidence = percent(next(iter(pairs.values()))["ERR"].confidence, 0)
    return Table(
        ["final masks", "ERR, pp", f"{confidence} % interval", *(f"{rate}, pp" for rate in OTHERS)],
        [
            [
                name,
                points(by_rate["ERR"].mean),
                marked_interval(by_rate["ERR"]),
                *(points(by_rate[rate].mean) for rate in OTHERS),
            ]
            for name, by_rate in pairs.items()
        ],
    )


def _show_files(outcome: Outcome, out: Console) -> None:
    """Print where the outputs lie, and what to type next; no path is broken: it can be copied."""
    if outcome.recording:
        out.print(f"recording  {outcome.recording} ({size(outcome.recording)})", soft_wrap=True)
    if outcome.reports:
        count = len(outcome.files)
        out.print(f"results    {outcome.reports}{os.sep} ({count} files)", soft_wrap=True)
    if place := outcome.recording or outcome.reports:
        console.show_next(out, *_next(outcome, place))


def _next(outcome: Outcome, place: Path) -> Iterator[str]:
    """Yield what to type next."""
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


def size(file: Path) -> str:
    """Write a file's size for a person."""
    bytes_ = file.stat().st_size
    return f"{bytes_ / 1e6:.1f} MB" if bytes_ >= 1e6 else f"{max(bytes_ / 1e3, 0.1):.1f} kB"
