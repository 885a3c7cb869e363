"""Drive by drive: plots of the differences, tables of drives, and what is missing of them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.data.words import DASH, number, percent, points
from roadeval.evaluation.score import BASES, TESTED
from roadeval.report.blocks import Block, Cell, Figure, Heading, LongTable, Table, Text
from roadeval.report.charts.differences import MEAN, ForestRow, caption, forest
from roadeval.report.findings import FleetFindings, Row
from roadeval.results.facts import OverDrives
from roadeval.results.schema import FAILED, LIGHT, UNSCORED

NAMED: Final = 12
"""Drives in the table of the worst, and in that of losses; reasons that are listed."""
OF_ONE_REASON: Final = 4
"""Drives named for one reason."""
TAGS: Final = 48
"""Letters of a drive's tags, at most."""
_WORDS: Final = ("drive", "state", "tags", "group")
_SHOWN: Final = ("ERR", "FPR", "FNR")


def plots(findings: FleetFindings) -> Iterator[Block]:
    """Yield the plots of the filter and of the best variant against blind, and the worst drives."""
    chosen = list(plotted(findings))
    if not findings.scores:
        return
    yield Heading("Drive by drive")
    for effect, title in chosen:
        yield Heading(title, 2)
        yield from _plot(findings, effect)
    yield Heading("Drives with the highest error rate", 2)
    yield worst_table(findings)
    yield Text("Percent; the differences in percentage points. Tags as they were given.", "note")


def plotted(findings: FleetFindings) -> Iterator[tuple[OverDrives, str]]:
    """Yield the differences that have a plot: of the filter, and of the best against blind."""
    known = [each for each in findings.facts.effects if each.metric == TESTED and each.units]
    for each in known:
        if (each.base, each.variant) == (UNFILTERED, FILTERED):
            yield each, "What the filter changes"
    blind = [each for each in known if each.base == BASELINE]
    if blind:
        best = min(blind, key=lambda each: each.mean)
        which = "" if len(blind) == 1 else ", the best variant,"
        yield best, f"What {best.variant}{which} gains over {best.base}"


def _plot(findings: FleetFindings, effect: OverDrives) -> Iterator[Block]:
    rows = [
        ForestRow(
            findings.names[row["drive"]],
            findings.drives[row["drive"]]["group"],
            row["mean"],
            row["low"],
            row["high"],
        )
        for row in findings.effects.get((effect.base, effect.variant), ())
    ]
    if rows:
        mean = ForestRow(MEAN, None, effect.mean, effect.low, effect.high)
        label = f"ERR of {effect.variant} minus that of {effect.base}"
        yield Figure(forest(rows, mean, label), caption(rows, mean))


def worst_table(findings: FleetFindings) -> Table:
    """Tabulate the drives on which the first variant has the highest ERR."""
    known = [row for row in findings.scores if row["ERR"] is not None]
    rows = sorted(known, key=lambda row: (-row["ERR"], row["drive"]))[:NAMED]
    differences, tags = _differences(findings), _tags(findings)
    tagged = any(tags.values())
    titles = ["drive", "frames", *_SHOWN, *(f"against {base}" for base in differences)]
    return Table(
        [*titles, *(["tags"] if tagged else [])],
        [
            [
                findings.names[row["drive"]],
                number(row["frames"]),
                *_rates(row),
                *(points(values.get(row["drive"])) for values in differences.values()),
                *([tags[row["drive"]]] if tagged else []),
            ]
            for row in rows
        ],
        text_columns=(0, len(titles)) if tagged else (0,),
        small=True,
    )


def _differences(findings: FleetFindings) -> dict[str, dict[str, float]]:
    """Return by base the differences by drive of the first variant, or the first that has any."""
    found = {}
    for base in BASES:
        variants = [variant for other, variant in findings.effects if other == base]
        if variants:
            first = findings.scores[0]["variant"]
            rows = findings.effects[base, first if first in variants else variants[0]]
            found[base] = {row["drive"]: row["mean"] for row in rows}
    return {base: values for base, values in found.items() if values}


def _tags(findings: FleetFindings) -> dict[str, str]:
    """Return the drives' tags in one line each, cut where they are many."""
    lines = {
        each.drive: ", ".join(f"{key}: {value}" for key, value in each.tags.items())
        for each in findings.facts.drives
    }
    return {
        drive: text if len(text) <= TAGS else f"{text[: TAGS - 1]}\N{HORIZONTAL ELLIPSIS}"
        for drive, text in lines.items()
    }


def _rates(score: Row | Mapping[str, float]) -> Iterator[Cell | str]:
    for name in _SHOWN:
        text = percent(score.get(name))
        yield Cell(text, bold=True) if name == TESTED else text


# --- All drives, on a page ------------------------------------------------------------------------


def table(findings: FleetFindings) -> Iterator[Block]:
    """Yield the table of all drives, to sort and to search."""
    yield Heading("All drives")
    yield LongTable(drives_table(findings), "Find drives, tags, states:")
    yield Text(
        "Rates of the first variant's final mask in percent; light as it was measured, from 0 to "
        "1. A click on a title sorts.",
        "note",
    )


def drives_table(findings: FleetFindings) -> Table:
    """Tabulate every drive with its state, its rates, its light and its tags."""
    scores = {row["drive"]: row for row in findings.scores}
    differences = _differences(findings) if scores else {}
    tags, pages = _tags(findings), findings.pages()
    light = [column.name for column in LIGHT]
    return Table(
        [*_WORDS, "frames", *_SHOWN, *(f"against {base}, pp" for base in differences), *light],
        [
            [
                Cell(findings.names[drive], leads=pages.get(drive, "")),
                str(row["status"]),
                tags.get(drive, ""),
                str(row["group"] or ""),
                number(row["evaluated"] or 0),
                *_rates(scores.get(drive, {})),
                *(points(values.get(drive)) for values in differences.values()),
                *(DASH if row[name] is None else f"{row[name]:.2f}" for name in light),
            ]
            for drive, row in findings.drives.items()
        ],
        text_columns=range(len(_WORDS)),
        small=True,
    )


# --- What is missing ------------------------------------------------------------------------------


def missing(findings: FleetFindings) -> Iterator[Block]:
    """Yield the drives that failed by reason, those without truth, and losses."""
    failed = [row for row in findings.drives.values() if row["status"] == FAILED]
    unscored = [row for row in findings.drives.values() if row["status"] == UNSCORED]
    damaged = [row for row in findings.drives.values() if row["losses"]]
    if not failed and not unscored and not damaged:
        return
    yield Heading("What is missing")
    for title, rows in (("Drives that failed", failed), ("Drives without a score", unscored)):
        if rows:
            yield Heading(f"{title}: {number(len(rows))}", 2)
            yield from _reasons(findings, rows)
    if damaged:
        yield Heading(f"Logs of which a part was lost: {number(len(damaged))}", 2)
        yield _losses(findings, damaged)
        if len(damaged) > NAMED:
            yield Text(f"{number(len(damaged) - NAMED)} more: see drives.parquet.", "note")


def _reasons(findings: FleetFindings, rows: list[Row]) -> Iterator[Block]:
    """Yield a table of reasons, the most frequent first."""
    by_reason: defaultdict[str, list[str]] = defaultdict(list)
    for row in rows:
        by_reason[_reason(row)].append(findings.names[row["drive"]])
    ranked = sorted(by_reason.items(), key=lambda each: -len(each[1]))
    yield Table(
        ["drives", "which", "reason"],
        [[number(len(names)), _first(names), reason] for reason, names in ranked[:NAMED]],
        text_columns=(0, 1, 2),
        small=True,
    )
    if len(ranked) > NAMED:
        more = sum(len(names) for _, names in ranked[NAMED:])
        yield Text(f"{number(more)} more for other reasons: see drives.parquet.", "note")


def _reason(row: Row) -> str:
    """Return why, without the name of the drive's file, which begins most reasons."""
    reason = row["reason"] or "no reason known"
    begin, _, rest = reason.partition(": ")
    return rest if rest and begin.rpartition("/")[2].startswith(row["name"]) else reason


def _first(names: list[str]) -> str:
    more = f" and {number(len(names) - OF_ONE_REASON)} more" if len(names) > OF_ONE_REASON else ""
    return f"{', '.join(names[:OF_ONE_REASON])}{more}"


def _losses(findings: FleetFindings, rows: list[Row]) -> Table:
    lost = []
    for row in rows[:NAMED]:
        first, *rest = row["losses"].splitlines()
        more = f" (and {len(rest)} more)" if rest else ""
        lost.append([findings.names[row["drive"]], f"{first}{more}"])
    return Table(["drive", "lost"], lost, text_columns=(0, 1), small=True)
