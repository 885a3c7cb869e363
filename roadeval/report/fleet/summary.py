"""The first page of a fleet's report: the verdict, the rates, and the differences over drives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from roadeval.data import BASELINE
from roadeval.data.words import DASH, defined, interval, listing, number, percent, points
from roadeval.evaluation.metrics import FULL, SHORT
from roadeval.evaluation.stats import STUDENT_FROM
from roadeval.report.blocks import (
    Block,
    BulletList,
    Cell,
    Heading,
    Table,
    TableOfContents,
    Text,
    TwoColumns,
)
from roadeval.report.fleet.findings import FleetFindings
from roadeval.report.sections.common import variant_cell

STATUSES: Final = {
    "scored": "scored",
    "damaged": "scored, but for what is lost of the log",
    "unscored": "without truth",
    "failed": "failed",
}
ROWS: Final = 24
"""Variants that the tables have, at most."""


def section(findings: FleetFindings) -> Iterator[Block]:
    """Yield the first page."""
    told = findings.summary
    yield Heading("Summary")
    yield Text(told["verdict"], "verdict")
    if note := _how_sure(told):
        yield Text(note, "note")
    if told["rates"]:
        yield rates_table(findings)
    if told["effects"]:
        yield effects_table(findings)
        yield Text(_effects_note(), "note")
    yield TwoColumns(
        [_counts(told)],
        [BulletList("Beware", warnings(findings) or ["Nothing known."], _tone(findings))],
    )
    yield TableOfContents()


def _tone(findings: FleetFindings) -> str:
    return "warning" if warnings(findings) else "plain"


def rates_table(findings: FleetFindings) -> Table:
    """Tabulate the final masks' rates; the best of each column is bold."""
    rows = findings.summary["rates"][:ROWS]
    names = [row["variant"] for row in rows]
    columns = {name: metric.higher_is_better for name, metric in FULL.items()}
    columns["pooled_ERR"] = False
    best = {name: _best([row[name] for row in rows], higher) for name, higher in columns.items()}
    return Table(
        ["final mask", "drives", "frames", *(name.replace("_", " ") for name in columns)],
        [
            [
                variant_cell(row["variant"], names),
                number(row["drives"]),
                number(row["frames"]),
                *(Cell(percent(row[name]), bold=row[name] == best[name]) for name in columns),
            ]
            for row in rows
        ],
        caption=(
            "Percent: the mean over drives of each drive's mean rate; pooled ERR is of all pixels "
            "of all drives together, so that long drives count for more. Bold: the best."
        ),
    )


def _best(values: list[float | None], higher: bool) -> float | None:
    known = [value for value in values if defined(value)]
    return (max if higher else min)(known, default=None)


def effects_table(findings: FleetFindings) -> Table:
    """Tabulate the differences over drives: the filter's, and each variant's against blind."""
    told = [each for each in findings.summary["effects"] if each["metric"] in SHORT]
    keys = list(dict.fromkeys((each["base"], each["variant"]) for each in told))[:ROWS]
    rows: list[list[Cell | str]] = []
    breaks = []
    for key in keys:
        breaks.append(len(rows))
        own = {each["metric"]: each for each in told if (each["base"], each["variant"]) == key}
        there = [name for name in SHORT if name in own]
        rows += [_effect_cells(own[name], first=name == there[0]) for name in there]
    return Table(
        ["difference", "rate", "mean", "interval", "worse", "better", "pooled"],
        rows,
        text_columns=(0, 1),
        breaks=breaks[1:],
        groups=[("", 2), ("over drives", 2), ("drives", 2), ("", 1)],
        small=True,
    )


def _effect_cells(each: Mapping[str, Any], *, first: bool) -> list[Cell | str]:
    return [
        f"{each['variant']} \N{MINUS SIGN} {each['base']}" if first else "",
        each["metric"],
        Cell(points(each["mean"]), bold=first),
        interval(each["low"], each["high"]),
        *(DASH if each[name] is None else number(each[name]) for name in ("worse", "better")),
        points(each["pooled"]),
    ]


def _effects_note() -> str:
    return (
        "Percentage points. A drive is as good as any other, long or short; drives of one group "
        "count as one. Pooled: of all pixels together."
    )


def _how_sure(told: Mapping[str, Any]) -> str:
    effects = [each for each in told["effects"] if each["metric"] == "ERR" and each["units"]]
    if not effects:
        return ""
    first = effects[0]
    if first["unit"] == "frames":
        return "One drive: intervals are those of its frames."
    groups = (
        f" The {first['units']} drives count as {first['groups']}: those of a group are one, "
        "and so are copies of a log."
        if first["groups"] < first["units"]
        else ""
    )
    if first["low"] is None:
        return f"No interval: it takes {first['needed']} drives or groups.{groups}"
    method = (
        "the exact sign-flip test" if first["groups"] < STUDENT_FROM else "Student's t over drives"
    )
    return (
        f"Intervals of {percent(first['confidence'], 0)} %, by {method}; the drive is the "
        f"unit.{groups}"
    )


def _counts(told: Mapping[str, Any]) -> Table:
    rows = [[text, number(told["counts"].get(name, 0))] for name, text in STATUSES.items()]
    rows.append(["all", number(len(told["drives"]))])
    return Table(["drives", "count"], rows, breaks=[len(STATUSES)], small=True)


def warnings(findings: FleetFindings) -> list[str]:
    """Return what a reader must know before believing the numbers."""
    return list(_warnings(findings))


def _warnings(findings: FleetFindings) -> Iterator[str]:
    told = findings.summary
    if failed := told["counts"].get("failed"):
        of = number(len(told["drives"]))
        yield f"{number(failed)} of {of} drives failed: no number counts them."
    if damaged := told["counts"].get("damaged"):
        yield f"{_drives(damaged)} scored without what is lost of the log."
    scored = [row for row in findings.drives.values() if row["evaluated"]]
    if own := sum(1 for row in scored if row["trained_on"] and not row["model"]):
        yield (
            f"{_drives(own)} scored by a model trained on the drive's own frames (none of "
            "these is evaluated): the rates say how well it does on a road that it has seen."
        )
    yield from _worse_than_baseline(told)
    yield from (f"{sentence}." for sentence in told.get("warnings", ()))


def _drives(count: int) -> str:
    return f"{number(count)} drive{' was' if count == 1 else 's were'}"


def _worse_than_baseline(told: Mapping[str, Any]) -> Iterator[str]:
    rates = {row["variant"]: row["ERR"] for row in told["rates"]}
    blind = rates.get(BASELINE)
    if not defined(blind):
        return
    if worse := [name for name, err in rates.items() if defined(err) and err > blind]:
        yield (
            f"{listing(worse)} {'is' if len(worse) == 1 else 'are'} worse than {BASELINE} (ERR "
            f"{percent(blind)} %), which never looks at the image."
        )
