"""Drive by drive: the plots of the differences, and the drives with the highest error rate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.data.words import number, percent, points
from roadeval.evaluation.score import BASES
from roadeval.report.blocks import Block, Cell, Figure, Heading, Table, Text
from roadeval.report.charts.differences import MEAN, ForestRow, caption, forest
from roadeval.report.fleet.findings import FleetFindings, Row

NAMED: Final = 12
"""Drives in the table of the worst."""
TAGS: Final = 48
"""Letters of a drive's tags, at most."""


def section(findings: FleetFindings) -> Iterator[Block]:
    """Yield the plots of the filter and of the best variant against blind, and the worst drives."""
    chosen = list(plotted(findings))
    if not findings.scores:
        return
    yield Heading("Drive by drive")
    for told, title in chosen:
        yield Heading(title, 2)
        yield from _plot(findings, told)
    yield Heading("Drives with the highest error rate", 2)
    yield worst_table(findings)
    yield Text("Percent; the differences in percentage points. Tags as they were given.", "note")


def plotted(findings: FleetFindings) -> Iterator[tuple[Mapping[str, Any], str]]:
    """Yield the differences that have a plot: of the filter, and of the best against blind."""
    tested = [each for each in findings.summary["effects"] if each["metric"] == "ERR"]
    told = [each for each in tested if each["units"]]
    for each in told:
        if (each["base"], each["variant"]) == (UNFILTERED, FILTERED):
            yield each, "What the filter changes"
    blind = [each for each in told if each["base"] == BASELINE]
    if blind:
        best = min(blind, key=lambda each: float(each["mean"]))
        which = "" if len(blind) == 1 else ", the best variant,"
        yield best, f"What {best['variant']}{which} gains over {best['base']}"


def _plot(findings: FleetFindings, told: Mapping[str, Any]) -> Iterator[Block]:
    rows = [
        ForestRow(
            findings.names[row["drive"]],
            findings.drives[row["drive"]]["group"],
            row["mean"],
            row["low"],
            row["high"],
        )
        for row in findings.effects.get((told["base"], told["variant"]), ())
    ]
    if not rows:
        return
    mean = ForestRow(MEAN, None, told["mean"], told["low"], told["high"])
    label = f"ERR of {told['variant']} minus that of {told['base']}"
    yield Figure(forest(rows, mean, label), caption(rows, mean))


def worst_table(findings: FleetFindings) -> Table:
    """Tabulate the drives on which the first variant has the highest ERR."""
    filters, blinds = (
        {row["drive"]: row["mean"] for row in against(findings, base)} for base in BASES
    )
    known = [row for row in findings.scores if row["ERR"] is not None]
    rows = sorted(known, key=lambda row: (-row["ERR"], row["drive"]))[:NAMED]
    columns = {"against unfiltered": filters, "against blind": blinds}
    shown = {title: values for title, values in columns.items() if values}
    tags = {each["drive"]: tags_in_words(each["tags"]) for each in findings.summary["drives"]}
    tagged = any(tags.values())
    titles = ["drive", "frames", "ERR", "FPR", "FNR", *shown, *(["tags"] if tagged else [])]
    return Table(
        titles,
        [
            [
                findings.names[row["drive"]],
                number(row["frames"]),
                Cell(percent(row["ERR"]), bold=True),
                percent(row["FPR"]),
                percent(row["FNR"]),
                *(points(values.get(row["drive"])) for values in shown.values()),
                *([tags[row["drive"]]] if tagged else []),
            ]
            for row in rows
        ],
        text_columns=(0, len(titles) - 1) if tagged else (0,),
        small=True,
    )


def against(findings: FleetFindings, base: str) -> Iterator[Row]:
    """Yield the differences from a base of the first variant, or of the first that has any."""
    variants = [variant for other, variant in findings.effects if other == base]
    first = findings.scores[0]["variant"]
    chosen = first if first in variants else next(iter(variants), None)
    yield from findings.effects.get((base, chosen), ()) if chosen else ()


def tags_in_words(tags: Mapping[str, str]) -> str:
    """Return a drive's tags in one line, cut where they are many."""
    text = ", ".join(f"{key}: {value}" for key, value in tags.items())
    return text if len(text) <= TAGS else f"{text[: TAGS - 1]}\N{HORIZONTAL ELLIPSIS}"
