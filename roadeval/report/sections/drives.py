"""The sections of many drives: differences, parts by tag, worst frames, missing ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.data.words import counted, first_of, number, percent, points
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.score.scoreboard import BASES, Effect
from roadeval.evaluation.tables import only, values_of
from roadeval.report.blocks import Block, Cell, Details, Heading, ImageFile, ImageGrid, Table, Text
from roadeval.report.charts.standard import forest
from roadeval.results.facts import StratumFacts
from roadeval.results.fleet import FleetFolder
from roadeval.results.rows import records
from roadeval.results.schema import FAILED, UNSCORED
from roadeval.results.sentences import MARK, is_significant, marked_interval
from roadeval.results.verdict import focus_of
from roadeval.runtime.text import elide

if TYPE_CHECKING:
    import pandas as pd

NAMED: Final = 12
"""Drives in the table of the worst, and in that of losses; reasons that are listed."""
OF_ONE_REASON: Final = 4
"""Drives named for one reason."""
TAGS: Final = 48
"""Letters of a drive's tags, at most."""
_WORDS: Final = ("drive", "state", "group", "tags")
_SHOWN: Final = (TESTED, "FPR", "FNR")


def plots(findings: FleetFolder) -> Iterator[Block]:
    """Yield the plots of the filter and of the best variant against blind, and the worst drives."""
    chosen = list(plotted(findings))
    if findings.focus_scores.empty:
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
    rows = only(findings.effects, base=effect.base, variant=effect.variant)
    if len(rows):
        groups = findings.drives["group"].reindex(rows["drive"]).to_numpy()
        rows = rows.assign(name=[findings.names[drive] for drive in rows["drive"]], group=groups)
        label = f"ERR of {effect.variant} minus that of {effect.base}"
        yield forest(rows, effect.rates[TESTED], label)


def _differences(findings: FleetFolder) -> dict[str, pd.Series[float]]:
    """Return by base the differences by drive of the focus, or the first variant that has any."""
    differences = {}
    for base in BASES:
        rows = only(findings.effects, base=base)
        if variants := values_of(rows, "variant"):
            focus = focus_of(findings.finals)
            rows = only(rows, variant=focus if focus in variants else variants[0])
            differences[base] = rows.set_index("drive")["mean"]
    return differences


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
        f"Rates of {focus_of(findings.finals)} in percent, differences in percentage points. A "
        "click on a title sorts.",
        "note",
    )


def drives_table(findings: FleetFolder, worst: int | None = None) -> Table:
    """Tabulate every drive with its state, its rates and its tags.

    Or the ``worst`` ones, those with the highest ERR, without state and group.
    """
    scores, tags, rows = findings.focus_scores, _tags(findings), findings.drives
    if worst is not None:
        ranked = scores[TESTED].dropna().sort_index().sort_values(ascending=False, kind="stable")
        rows = rows.loc[ranked.index[:worst]]
    scores = scores.reindex(rows.index)
    columns: dict[str, Sequence[Cell | str]] = {
        "drive": [findings.names[drive] for drive in rows.index],
        "state": rows["status"].tolist(),
        "group": rows["group"].astype(object).fillna("").tolist(),
        "tags": [tags.get(drive, "") for drive in rows.index],
        "frames": [number(int(count)) for count in rows["evaluated"].fillna(0)],
        **{r: [Cell(percent(rate), bold=r == TESTED) for rate in scores[r]] for r in _SHOWN},
        **{
            f"against {base}": [*map(points, own.reindex(rows.index))]
            for base, own in _differences(findings).items()
        },
    }
    if worst is not None:
        unused = ["state", "group", *([] if any(tags.values()) else ["tags"])]
        columns = {title: cells for title, cells in columns.items() if title not in unused}
    return Table(
        [*columns],
        [*zip(*columns.values(), strict=True)],
        text_columns=[place for place, title in enumerate(columns) if title in _WORDS],
        small=True,
    )


def missing(findings: FleetFolder) -> Iterator[Block]:
    """Yield the drives that failed by reason, those without truth, and those with losses."""
    drives = findings.drives
    parts = {
        "Drives that failed": only(drives, status=FAILED),
        "Drives without a score": only(drives, status=UNSCORED),
        "Logs of which a part was lost": drives[drives["losses"].notna()],
    }
    if any(map(len, parts.values())):
        yield Heading("What is missing")
    for title, own in parts.items():
        if len(own):
            yield Heading(f"{title}: {number(len(own))}", 2)
            yield from _reasons(findings, own)


def _reasons(findings: FleetFolder, rows: pd.DataFrame) -> Iterator[Block]:
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


def by_reason(findings: FleetFolder, rows: pd.DataFrame) -> dict[str, list[str]]:
    """Return the drives' names by what was lost first, or by why they failed or were not scored.

    Without the name of the drive's file, which begins most reasons.
    """
    drives: defaultdict[str, list[str]] = defaultdict(list)
    for drive, row in zip(rows.index, records(rows), strict=True):
        first, *_ = (row["losses"] or row["reason"] or "no reason known").splitlines()
        begin, _, rest = first.partition(": ")
        is_file = rest and begin.rpartition("/")[2].startswith(row["name"])
        drives[rest if is_file else first].append(findings.names[drive])
    return drives


def strata(findings: FleetFolder) -> Iterator[Block]:
    """Yield a table of parts by tag for each difference that has a plot."""
    if findings.facts.strata:
        yield Heading("By tag")
    for effect, title in plotted(findings):
        mask = (effect.base, effect.variant)
        own = [each for each in findings.facts.strata if (each.base, each.variant) == mask]
        begins = [place for place, part in enumerate(own) if part.tag != own[place - 1].tag]
        parts = Table(
            ["by", "value", "drives", "mean", "interval", "worse", "better"],
            [
                [part.tag if place in (0, *begins) else "", *_part_cells(part)]
                for place, part in enumerate(own)
            ],
            text_columns=(0, 1),
            breaks=[place for place in begins if place],
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


def _part_cells(part: StratumFacts) -> list[Cell | str]:
    change = part.difference
    return [
        part.value,
        number(change.units),
        Cell(points(change.mean), bold=is_significant(change)),
        marked_interval(change),
        *(number(count or 0) for count in (change.worse, change.better)),
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
    rows = records(findings.worst[:most])
    if not rows:
        return
    yield Heading(f"The worst frames of {focus_of(findings.finals)} over all drives")
    pictures = []
    for row in rows:
        title = f"{elide(findings.names[row['drive']], LONGEST)}, frame {row['frame']}"
        if content := findings.picture(row):
            error = f"ERR {percent(row[TESTED], 1)} %"
            pictures.append((f"{row['rank']}. {title}: {error}", ImageFile(content)))
    if pictures:
        yield ImageGrid(pictures[:SEEN], across)
    if more := pictures[SEEN:]:
        yield Details(f"{len(more)} more", [ImageGrid(more, across)])
    legend = (
        f"By ERR of {focus_of(findings.finals)}; of a drive at most three, a second apart. "
        "Green: road found; orange: non-road called road (FP); purple: road missed (FN); "
        "grey: ignored."
    )
    if lacking := len(rows) - len(pictures):
        legend += f" Not in the folder: {counted(lacking, 'picture')}."
    yield Text(legend, "note")
    yield _commands_table(findings, rows)


def _commands_table(findings: FleetFolder, rows: Sequence[dict[str, Any]]) -> Table:
    """Tabulate the worst frames with the command that opens each in the viewer."""
    return Table(
        ["", "drive", "frame", "ERR, %", "in the viewer"],
        [
            [
                str(row["rank"]),
                findings.names[row["drive"]],
                str(row["frame"]),
                Cell(percent(row[TESTED]), bold=True),
                findings.inspect(row),
            ]
            for row in rows
        ],
        text_columns=(0, 1, 4),
        small=True,
    )
