"""The tables of rates and differences of a drive or of many, for a terminal, paper and a page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final

from roadeval.data import words
from roadeval.data.words import DASH, MINUS, defined, in_percent, number, percent, points
from roadeval.evaluation.metrics import FULL, METRICS, SHORT, SHORT_UNTABLED, TESTED, UNTABLED
from roadeval.report.blocks import Cell, Table
from roadeval.report.captions import caption
from roadeval.report.chart import looks
from roadeval.results.facts import Facts, FleetFacts, Totals
from roadeval.results.sentences import describe_overconfidence, marked_interval

OTHERS: Final = tuple(rate for rate in SHORT if rate != TESTED)
"""The rates of short tables other than ERR."""


def variant_cell(name: str, names: Sequence[str], text: str = "") -> Cell:
    """Return a cell with a variant's name, or a text, and its mark in charts of ``names``."""
    return Cell(text or name, look=looks(names)[name])


def breaks_of(rows: Sequence[Sequence[Cell | str]]) -> list[int]:
    """Return the positions of rows with text in their first cell, without the first row."""
    return [place for place, row in enumerate(rows) if place and row[0]]


def best_bold(values: Sequence[float | None], *, higher: bool) -> Iterator[Cell]:
    """Yield a cell in percent for each value; the best one is bold."""
    best = (max if higher else min)(filter(defined, values), default=None)
    place = None if best is None else values.index(best)
    yield from (Cell(percent(value), bold=i == place) for i, value in enumerate(values))


def rates_table(facts: Facts | FleetFacts) -> Table:
    """Tabulate every final mask's rates; the best rate of each column is bold."""
    finals = facts.final_totals
    of_fleet, names = isinstance(facts, FleetFacts), [*finals]
    counts = [number(total["frames"]) for total in finals.values()]
    alike = len(set(counts)) == 1 and not of_fleet
    columns: dict[str, Iterable[Cell | str]] = {}
    if of_fleet:
        columns["drives"] = [number(total["drives"]) for total in finals.values()]
    if not alike:
        columns["frames"] = counts
    shown = {name.replace("_", " "): (name, metric) for name, metric in FULL.items()}
    shown[f"pooled {TESTED}"] = f"pooled_{TESTED}", METRICS[TESTED]
    if not of_fleet:
        shown |= {name: (f"pooled_{name}", metric) for name, metric in UNTABLED.items()}
    for title, (rate, metric) in shown.items():
        values = [total.get(rate) for total in finals.values()]
        columns[title] = best_bold(values, higher=metric.higher_is_better)
    if isinstance(facts, FleetFacts):
        sentences = [caption("rates of a fleet")]
    else:
        frames = counts[0] if alike else "the evaluated"
        sentences = [caption("rates", frames=frames, untabled=words.listing([*UNTABLED]))]
        if widths := {measured["width"] for measured in facts.beyond.values()}:
            for name in ("boundary_F", "boundary_IoU"):
                values = [facts.beyond.get(variant, {}).get(name) for variant in finals]
                columns[name.replace("_", " ")] = best_bold(values, higher=True)
            sentences.append(caption("boundary", width=widths.pop()))
    sentences.append(caption("bold"))
    rows = zip(*columns.values(), strict=True)
    return Table(
        ["final mask", *columns],
        [[variant_cell(name, names), *row] for name, row in zip(names, rows, strict=True)],
        small=not of_fleet,
        name="rates",
        caption=" ".join(sentences),
    )


def stages_table(
    totals: Totals, changes: Mapping[tuple[str, str], Sequence[float]] | None = None
) -> Table:
    """Tabulate the rates of every stage, and the shares of pixels that it repaired and spoiled."""
    rows: list[list[Cell | str]] = [
        [
            "" if place else variant_cell(variant, [*totals]),
            stage,
            number(total["frames"]),
            *(percent(total.get(n)) for n in FULL),
            *(percent(total.get(f"pooled_{n}")) for n in (TESTED, *SHORT_UNTABLED)),
            *(map(percent, changes.get((variant, stage), (None, None))) if changes else ()),
        ]
        for variant, stages in totals.items()
        for place, (stage, total) in enumerate(stages.items())
    ]
    changed = ["repaired", "spoiled"] if changes else []
    meanings = "; ".join(f"{name}: {metric.in_words}" for name, metric in SHORT.items())
    return Table(
        ["variant", "stage", "frames", *FULL, "pooled ERR", *SHORT_UNTABLED, *changed],
        rows,
        text_columns=(0, 1),
        breaks=breaks_of(rows),
        caption=f"Percent. {meanings}.",
        small=True,
    )


def differences_table(facts: Facts | FleetFacts, *, brief: bool = False) -> Table:
    """Tabulate the differences of final masks, over the frames of a drive or over drives.

    A ``brief`` table has only the differences, without both errors and without the numbers of
    better and worse frames.
    """
    effects, finals = facts.final_effects, facts.final_totals
    unit = effects[0].rates[TESTED].unit
    rows: list[list[Cell | str]] = []
    for effect in effects:
        change, title = effect.rates[TESTED], f"{effect.variant} {MINUS} {effect.base}"
        ends = [percent(finals[name][TESTED]) for name in (effect.base, effect.variant)]
        won = [number(count or 0) for count in (change.better, change.worse)]
        if unit == "frames":
            won.append(DASH if change.effective is None else f"{change.effective:.0f}")
        rows.append(
            [
                variant_cell(effect.variant, [*finals], title),
                *([] if brief else ends),
                points(change.mean),
                marked_interval(change),
                *(points(effect.rates[rate].mean) for rate in OTHERS),
                *([] if brief else won),
            ]
        )
    ends = [] if brief else ["from", "to"]
    counts = [] if brief else ["better", "worse", *(["effective"] if unit == "frames" else [])]
    interval = f"{in_percent(effects[0].rates[TESTED].confidence):g} % interval"
    wide = [("", 1), ("ERR, %", 2), ("points", 2 + len(OTHERS)), (unit, len(counts))]
    return Table(
        ["difference" + ", points" * brief, *ends, TESTED, interval, *OTHERS, *counts],
        rows,
        breaks=[place for place, (a, b) in enumerate(pairwise(effects), 1) if a.base != b.base],
        groups=[] if brief else wide,
        small=True,
    )


def thresholds_table(curves: Totals, totals: Totals) -> Table:
    """Tabulate AP and MaxF over all thresholds, ECE, and F1 of the mask as it is."""
    rows: list[list[Cell | str]] = [
        [
            variant_cell(variant, [*totals]),
            stage,
            percent(curve["AP"]),
            percent(curve["MaxF"]),
            f"{curve['threshold']:.5g}" if defined(curve["threshold"]) else DASH,
            percent(curve.get("ECE")),
            percent(totals[variant][stage].get("pooled_F1")),
        ]
        for variant, stages in curves.items()
        for stage, curve in stages.items()
    ]
    return Table(
        ["variant", "stage", "AP", "MaxF", "threshold", "ECE", "F1 as it is"],
        rows,
        text_columns=(0, 1),
        caption=" ".join((caption("thresholds"), *describe_overconfidence(curves))),
        small=True,
    )


def cameras_table(facts: Facts) -> Table:
    """Tabulate ERR of each camera's final masks, and the first pair's difference in each camera."""
    names, masks = words.short_names([*facts.cameras]), [*facts.finals]
    pairs = [(effect.variant, effect.base) for effect in facts.final_effects[:1]]
    rows: list[list[Cell | str]] = []
    for camera, of_camera in facts.cameras.items():
        errors = {name: total[TESTED] for name, total in of_camera.final_totals.items()}
        changes = {(e.variant, e.base): e.rates[TESTED] for e in of_camera.final_effects}
        row: list[Cell | str] = [names[camera], number(of_camera.frames.evaluated)]
        row += best_bold([errors.get(name) for name in masks], higher=False)
        for pair in pairs:
            change = changes.get(pair)
            row += [points(change.mean), marked_interval(change)] if change else [DASH, DASH]
        rows.append(row)
    titles = [title for a, b in pairs for title in (f"{a} {MINUS} {b}", "interval")]
    return Table(
        ["camera", "frames", *masks, *titles],
        rows,
        caption=f"{caption('cameras')} {caption('bold')}",
        small=True,
    )
