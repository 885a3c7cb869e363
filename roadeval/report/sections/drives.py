"""The sections of many drives: differences, parts by tag, worst frames, missing ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.data.words import counted, first_of, number, percent, points
from roadeval.evaluation.score import BASES, TESTED, Effect
from roadeval.report.blocks import (
    Block,
    Cell,
    Details,
    Heading,
    ImageFile,
    ImageGrid,
    Table,
    Text,
)
from roadeval.report.charts.standard import ForestRow, forest
from roadeval.results.facts import StratumFacts
from roadeval.results.fleet import FleetFolder
from roadeval.results.schema import FAILED, UNSCORED
from roadeval.results.sentences import MARK, is_significant, marked_interval
from roadeval.runtime.text import elided

NAMED: Final = 12
"""Drives in the table of the worst, and in that of losses; reasons that are listed."""
OF_ONE_REASON: Final = 4
"""Drives named for one reason."""
TAGS: Final = 48
"""Letters of a drive's tags, at most."""
_WORDS: Final = ("drive", "state", "group", "tags")
_SHOWN: Final = ("ERR", "FPR", "FNR")
Row = Mapping[str, Any]


def plots(findings: FleetFolder) -> Iterator[Block]:
    """Yield the plots of the filter and of the best variant against blind, and the worst drives."""
    chosen = list(plotted(findings))
    if not findings.first_scores:
        return
    yield Heading("Drive by drive")
    for place, (effect, title) in enumerate(chosen):
        plot = [*_plot(findings, effect)]
        yield from [Details(title, plot)] if place else [Heading(title, 2), *plot]
    units = Text("Percent; the differences in percentage points.", "note")
    yield Details("Drives with the highest error rate", [drives_table(findings, NAMED), units])


def plotted(findings: FleetFolder) -> Iterator[tuple[Effect, str]]:
    """Yield the differences that have a plot: of the filter, and of the best against blind."""
    known = [each for each in findings.facts.effects if each.rates[TESTED].units]
    for each in known:
        if (each.base, each.variant) == (UNFILTERED, FILTERED):
            yield each, "What the filter changes"
    blind = [each for each in known if each.base == BASELINE]
    if blind:
        best = min(blind, key=lambda each: each.rates[TESTED].mean)
        which = "" if len(blind) == 1 else ", the best variant,"
        yield best, f"What {best.variant}{which} gains over {best.base}"


def _plot(findings: FleetFolder, effect: Effect) -> Iterator[Block]:
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
        label = f"ERR of {effect.variant} minus that of {effect.base}"
        yield forest(rows, effect.rates[TESTED], label)


def _differences(findings: FleetFolder) -> dict[str, dict[str, float]]:
    """Return by base the differences by drive of the first variant, or the first that has any."""
    found = {}
    for base in BASES:
        variants = [variant for other, variant in findings.effects if other == base]
        if variants:
            first = next(iter(findings.finals))
            rows = findings.effects[base, first if first in variants else variants[0]]
            found[base] = {row["drive"]: row["mean"] for row in rows}
    return {base: values for base, values in found.items() if values}


def _tags(findings: FleetFolder) -> dict[str, str]:
    """Return the drives' tags in one line each, cut where they are many."""
    lines = {
        each.drive: ", ".join(f"{key}: {value}" for key, value in each.tags.items())
        for each in findings.facts.drives
    }
    return {
        drive: text if len(text) <= TAGS else f"{text[: TAGS - 1]}\N{HORIZONTAL ELLIPSIS}"
        for drive, text in lines.items()
    }


def table(findings: FleetFolder) -> Iterator[Block]:
    """Yield the table of all drives, to sort and to search."""
    yield Heading("All drives")
    yield replace(drives_table(findings), find="Find drives, tags, states:")
    yield Text(
        "Rates of the first variant's final mask in percent, differences in percentage points. A "
        "click on a title sorts.",
        "note",
    )


def drives_table(findings: FleetFolder, worst: int | None = None) -> Table:
    """Tabulate every drive with its state, its rates and its tags.

    Or the ``worst`` ones, those with the highest ERR, without state and group.
    """
    scores, differences = findings.first_scores, _differences(findings)
    tags = _tags(findings)
    columns: dict[str, Callable[[str], Cell | str]] = {
        "drive": lambda drive: findings.names[drive],
        "state": lambda drive: str(findings.drives[drive]["status"]),
        "group": lambda drive: str(findings.drives[drive]["group"] or ""),
        "tags": lambda drive: tags.get(drive, ""),
        "frames": lambda drive: number(findings.drives[drive]["evaluated"] or 0),
        **{rate: partial(_rate, scores, rate) for rate in _SHOWN},
        **{f"against {base}": partial(_point, own) for base, own in differences.items()},
    }
    shown = [*findings.drives]
    if worst is not None:
        known = (row for row in scores.values() if row[TESTED] is not None)
        ranked = sorted(known, key=lambda row: (-row[TESTED], row["drive"]))
        shown = [row["drive"] for row in ranked[:worst]]
        unused = ["state", "group", *([] if any(tags.values()) else ["tags"])]
        columns = {title: cell for title, cell in columns.items() if title not in unused}
    return Table(
        [*columns],
        [[cell(drive) for cell in columns.values()] for drive in shown],
        text_columns=[place for place, title in enumerate(columns) if title in _WORDS],
        small=True,
    )


def _rate(scores: Mapping[str, Row], rate: str, drive: str) -> Cell:
    return Cell(percent(scores.get(drive, {}).get(rate)), bold=rate == TESTED)


def _point(values: Mapping[str, float], drive: str) -> str:
    return points(values.get(drive))


def missing(findings: FleetFolder) -> Iterator[Block]:
    """Yield the drives that failed by reason, those without truth, and those with losses."""
    rows = findings.drives.values()
    parts = {
        "Drives that failed": [row for row in rows if row["status"] == FAILED],
        "Drives without a score": [row for row in rows if row["status"] == UNSCORED],
        "Logs of which a part was lost": [row for row in rows if row["losses"]],
    }
    if any(parts.values()):
        yield Heading("What is missing")
    for title, own in parts.items():
        if own:
            yield Heading(f"{title}: {number(len(own))}", 2)
            yield from _reasons(findings, own)


def _reasons(findings: FleetFolder, rows: Sequence[Row]) -> Iterator[Block]:
    """Yield a table of reasons, the most frequent first."""
    ranked = sorted(by_reason(findings, rows).items(), key=lambda each: -len(each[1]))
    yield Table(
        ["drives", "which", "reason"],
        [
            [number(len(names)), first_of(names, OF_ONE_REASON), reason]
            for reason, names in ranked[:NAMED]
        ],
        text_columns=(0, 1, 2),
        small=True,
    )
    if len(ranked) > NAMED:
        more = sum(len(names) for _, names in ranked[NAMED:])
        yield Text(f"{number(more)} more for other reasons: see drives.parquet.", "note")


def by_reason(findings: FleetFolder, rows: Iterable[Row]) -> dict[str, list[str]]:
    """Return the drives' names by what was lost first, or by why they failed or were not scored.

    Without the name of the drive's file, which begins most reasons.
    """
    found: defaultdict[str, list[str]] = defaultdict(list)
    for row in rows:
        first, *_ = (row["losses"] or row["reason"] or "no reason known").splitlines()
        begin, _, rest = first.partition(": ")
        is_file = rest and begin.rpartition("/")[2].startswith(row["name"])
        found[rest if is_file else first].append(findings.names[row["drive"]])
    return found


def strata(findings: FleetFolder) -> Iterator[Block]:
    """Yield a table of parts by tag for each difference that has a plot."""
    if findings.facts.strata:
        yield Heading("By tag")
    for effect, title in plotted(findings):
        mask = (effect.base, effect.variant)
        own = [each for each in findings.facts.strata if (each.base, each.variant) == mask]
        first = [place == 0 or own[place - 1].tag != row.tag for place, row in enumerate(own)]
        parts = Table(
            ["by", "value", "drives", "mean", "interval", "worse", "better"],
            [_part_cells(row, first=begins) for row, begins in zip(own, first, strict=True)],
            text_columns=(0, 1),
            breaks=[place for place, begins in enumerate(first) if begins and place],
            small=True,
        )
        count = max((each.difference.comparisons or 0 for each in own), default=0)
        note = (
            f"{MARK} significant after Holm's correction for the {count} parts that were tested "
            "together."
            if count
            else "No part has enough drives, or groups of them, for an interval."
        )
        if own:
            told = Text(f"Percentage points, means over drives. {note}", "note")
            yield Details(title, [parts, told])


def _part_cells(row: StratumFacts, *, first: bool) -> list[Cell | str]:
    found = row.difference
    return [
        row.tag if first else "",
        row.value,
        number(found.units),
        Cell(points(found.mean), bold=is_significant(found)),
        marked_interval(found),
        number(found.worse or 0),
        number(found.better or 0),
    ]


WORST_AT: Final = "#the-worst-frames-over-all-drives"
"""Address of the worst frames on the page of a fleet: their heading."""
SEEN: Final = 12
"""Pictures that a page shows at once."""
ACROSS = 4
LONGEST = 20
"""Letters of a drive's name below a picture."""


def worst(findings: FleetFolder, across: int = ACROSS, most: int = SEEN) -> Iterator[Block]:
    """Yield the worst frames, at most so many, and so many pictures beside each other."""
    rows = findings.worst[:most]
    if not rows:
        return
    yield Heading("The worst frames over all drives")
    pictures = []
    for row in rows:
        title = f"{elided(findings.names[row['drive']], LONGEST)}, frame {row['frame']}"
        if content := findings.picture(row):
            error = f"ERR {percent(row['ERR'], 1)} %"
            pictures.append((f"{row['rank']}. {title}: {error}", ImageFile(content)))
    if pictures:
        yield ImageGrid(pictures[:SEEN], across)
    if more := pictures[SEEN:]:
        yield Details(f"{len(more)} more", [ImageGrid(more, across)])
    legend = (
        "By ERR of the first variant's final mask; of a drive at most three, a second apart. "
        "Green: road found; orange: non-road called road (FP); purple: road missed (FN); "
        "grey: ignored."
    )
    if lacking := len(rows) - len(pictures):
        legend += f" Not in the folder: {counted(lacking, 'picture')}."
    yield Text(legend, "note")
    yield _commands_table(findings, rows)


def _commands_table(findings: FleetFolder, rows: Sequence[Row]) -> Table:
    """Tabulate the worst frames with the command that opens each in the viewer."""
    return Table(
        ["", "drive", "frame", "ERR, %", "in the viewer"],
        [
            [
                str(row["rank"]),
                findings.names[row["drive"]],
                str(row["frame"]),
                Cell(percent(row["ERR"]), bold=True),
                findings.inspect(row),
            ]
            for row in rows
        ],
        text_columns=(0, 1, 4),
        small=True,
    )
