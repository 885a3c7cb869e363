"""The sections of many drives: first page, differences, tags, worst frames, missing drives."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING, Final
from urllib.parse import quote

import numpy as np

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.data.words import counted, first_of, number, percent, points
from roadeval.evaluation.metrics import SHORT, TESTED
from roadeval.evaluation.score.scoreboard import BASES, Effect
from roadeval.evaluation.tables import finals, group_rows, only, values_of
from roadeval.report.blocks import (
    Block,
    Details,
    DriveRow,
    Heading,
    ImageFile,
    ImageGrid,
    LinkList,
    Table,
    Text,
)
from roadeval.report.captions import caption, note
from roadeval.report.chart import Chart, ChartKind, Series, looks, thin
from roadeval.report.charts.standard import forest
from roadeval.report.sections.failures import beware, why, worse_than_baseline
from roadeval.report.tables import breaks_of, differences_table, rates_table
from roadeval.results.fleet import APART_NS, OF_A_DRIVE, FleetFolder, results_path
from roadeval.results.rows import records
from roadeval.results.schema import DAMAGED, FAILED, SCORED, UNSCORED
from roadeval.results.sentences import MARK, marked_interval
from roadeval.runtime.text import elide

if TYPE_CHECKING:
    import pandas as pd

NAMED: Final = 12
"""Greatest number of drives in the table of the worst, and of reasons why drives are missing."""
OF_ONE_REASON: Final = 4
"""Greatest number of drives that are named for one reason."""
TAGS: Final = 48
"""Greatest number of letters of a drive's tags."""
STATUSES: Final = {
    SCORED: "scored",
    DAMAGED: "scored without the lost part",
    UNSCORED: "without truth",
    FAILED: "failed",
}


def summary(findings: FleetFolder) -> Iterator[Block]:
    """Yield the first page of a fleet."""
    yield Heading("Summary")
    facts = findings.facts
    yield Text(facts.verdict, "verdict")
    yield from why(facts)
    for frame in records(findings.worst[:1]):
        where = f"{findings.names[frame['drive']]}, frame {frame['frame']}"
        title = f"Worst frame: {where} (ERR {percent(frame[TESTED], 1)} %)"
        yield LinkList([(title, WORST_AT)], findings.inspect(frame))
    if facts.totals:
        yield rates_table(facts)
    if facts.effects:
        yield differences_table(facts)
        yield note("weights of drives")
    yield Text(f"{drives_account(facts.counts, facts.frames)}.", "note")
    yield beware([*warnings(findings)])


def warnings(findings: FleetFolder) -> Iterator[str]:
    """Yield the reasons to doubt the numbers of many drives."""
    facts = findings.facts
    if failed := facts.counts.get(FAILED):
        yield caption("failed drives", failed=number(failed), drives=number(len(facts.drives)))
    if damaged := facts.counts.get(DAMAGED):
        yield caption("damaged drives", drives=_were(damaged))
    drives = findings.drives
    trained_here = (drives["evaluated"] > 0) & (drives["trained_on"] > 0) & drives["model"].isna()
    if count := int(trained_here.sum()):
        yield caption("drives that trained their models", drives=_were(count))
    if worse := worse_than_baseline(facts):
        yield caption("worse than blind in a fleet", worse=worse)
    yield from (f"{sentence}." for sentence in facts.warnings)


def _were(count: int) -> str:
    return f"{counted(count, 'drive')} {'was' if count == 1 else 'were'}"


def drives_account(counts: Mapping[str, int], frames: int) -> str:
    """Return the numbers of drives, by their states, and of evaluated frames."""
    states = (f"{number(counts[s])} {text}" for s, text in STATUSES.items() if counts.get(s))
    drives = counted(sum(counts.values()), "drive")
    return f"{drives}: {', '.join(states)}; {number(frames)} frames evaluated"


def plots(findings: FleetFolder) -> Iterator[Block]:
    """Yield the effects of the filter and the best variant on each drive, and the worst drives."""
    if findings.focus_scores.empty:
        return
    yield Heading("Drive by drive")
    for place, (effect, title) in enumerate(main_effects(findings)):
        rows = only(findings.effects, base=effect.base, variant=effect.variant)
        groups = findings.drives["group"].reindex(rows["drive"]).to_numpy()
        rows = rows.assign(name=[findings.names[drive] for drive in rows["drive"]], group=groups)
        label = f"ERR of {effect.variant} minus that of {effect.base}"
        plot = [forest(rows, effect.rates[TESTED], label)] if len(rows) else []
        yield from [Details(title, plot)] if place else [Heading(title, 2), *plot]
    blocks = [drives_table(findings, NAMED), note("units")]
    yield Details(f"Drives with the highest error rate of {findings.facts.focus}", blocks)


def main_effects(findings: FleetFolder) -> Iterator[tuple[Effect, str]]:
    """Yield the effects of the filter and of the best variant against blind, with their titles."""
    effects = [effect for effect in findings.facts.effects if effect.rates[TESTED].units]
    for effect in effects:
        if (effect.base, effect.variant) == (UNFILTERED, FILTERED):
            yield effect, "What the filter changes"
    against_blind = [effect for effect in effects if effect.base == BASELINE]
    if against_blind:
        best = min(against_blind, key=lambda effect: effect.rates[TESTED].mean)
        which = "" if len(against_blind) == 1 else ", the best variant,"
        yield best, f"What {best.variant}{which} gains over {best.base}"


def table(findings: FleetFolder) -> Iterator[Block]:
    """Yield the table of all drives, to sort and to search."""
    yield Heading("All drives")
    yield replace(drives_table(findings), find="Find drives, tags, states:")
    yield note("sorted drives", variant=findings.facts.focus)


ROW_PICTURES: Final = 3
"""Worst frames beside the error rate of a drive."""
ROW_POINTS: Final = 120
PAGE: Final = "report.html"
"""The name of a drive's page in the folder of its results."""


def along(findings: FleetFolder, most: int, beside: Path) -> Iterator[Block]:
    """Yield the error rate of the focus along each drive, the worst drive first.

    The first drives have pictures of their worst frames, at most ``most`` in all. Links to the
    pages of drives are relative to the folder ``beside``.
    """
    focus, scores = findings.facts.focus, findings.focus_scores
    if focus is None or scores.empty:
        return
    rates = scores[TESTED].dropna().sort_index().sort_values(ascending=False, kind="stable")
    frames = finals(only(findings.table("frames"), variant=focus))
    top, look = 100 * max(frames[TESTED].max(), 0.01), looks([*findings.facts.finals])[focus]
    yield Heading(f"Along each drive: {focus}")
    yield note("along drives", variant=focus)
    rows = {drive: part for (drive,), part in group_rows(frames, ["drive"])}
    pictured = findings.pictured.sort_values(TESTED, ascending=False, kind="stable")
    shown_frames = {drive: part for (drive,), part in group_rows(pictured, ["drive"])}
    for drive, rate in rates.items():
        part = rows[drive]
        position = np.linspace(0, 100, len(part)).tolist() if len(part) > 1 else [0.0]
        line = Series(focus, look, position, (100 * part[TESTED]).tolist())
        pictures = []
        for row in records(shown_frames.get(drive, frames[:0])[: min(ROW_PICTURES, most)]):
            if content := findings.picture(row):
                title = f"frame {row['frame']}: {percent(row[TESTED], 1)} %"
                pictures.append((title, ImageFile(content)))
        most -= len(pictures)
        page = results_path(findings.path, str(drive)) / PAGE
        yield DriveRow(
            findings.names[str(drive)],
            f"ERR {percent(rate)} %",
            Chart(
                *("ERR", ChartKind.LINES, [thin(line, ROW_POINTS)]),
                across="part of the drive",
                x_range=(0.0, 100.0),
                y_range=(0.0, top),
                low=True,
            ),
            quote(relpath(page, beside)) if page.is_file() else "",
            pictures,
        )


def drives_table(findings: FleetFolder, worst: int | None = None) -> Table:
    """Tabulate every drive with its state, its rates and its tags.

    With ``worst`` it has that many drives with the highest ERR, and neither state nor group.
    """
    scores, rows = findings.focus_scores, findings.drives
    tags = {}
    for drive in findings.facts.drives:
        text = ", ".join(f"{key}: {value}" for key, value in drive.tags.items())
        cut = f"{text[: TAGS - 1]}\N{HORIZONTAL ELLIPSIS}"
        tags[drive.drive] = text if len(text) <= TAGS else cut
    if worst is not None:
        ranked = scores[TESTED].dropna().sort_index().sort_values(ascending=False, kind="stable")
        rows = rows.loc[ranked.index[:worst]]
    scores = scores.reindex(rows.index)
    columns: dict[str, list[str]] = {
        "drive": [findings.names[drive] for drive in rows.index],
        "state": rows["status"].tolist(),
        "group": rows["group"].astype(object).fillna("").tolist(),
        "tags": [tags.get(drive, "") for drive in rows.index],
        "frames": [number(int(count)) for count in rows["evaluated"].fillna(0)],
        **{rate: [*map(percent, scores[rate])] for rate in SHORT},
    }
    for base in BASES:  # differences of the focus, if it has any, or of another variant
        effects = only(findings.effects, base=base)
        if variants := values_of(effects, "variant"):
            focus = findings.facts.focus
            effects = only(effects, variant=focus if focus in variants else variants[0])
            changes = effects.set_index("drive")["mean"].reindex(rows.index)
            columns[f"against {base}"] = [*map(points, changes)]
    unused = [title for title in ("group", "tags") if not any(columns[title])]
    unused += [] if worst is None else ["state", "group"]
    columns = {title: cells for title, cells in columns.items() if title not in unused}
    words = ("drive", "state", "group", "tags")
    return Table(
        [*columns],
        [*zip(*columns.values(), strict=True)],
        text_columns=[place for place, title in enumerate(columns) if title in words],
        small=True,
    )


def missing(findings: FleetFolder) -> Iterator[Block]:
    """Yield the drives that failed, have no truth or lost a part, each by their reasons.

    The most frequent reason is the first.
    """
    drives = findings.drives
    parts = {
        "Drives that failed": only(drives, status=FAILED),
        "Drives without a score": only(drives, status=UNSCORED),
        "Logs of which a part was lost": drives[drives["losses"].notna()],
    }
    if any(map(len, parts.values())):
        yield Heading("What is missing")
    for title, rows in parts.items():
        if not len(rows):
            continue
        yield Heading(f"{title}: {number(len(rows))}", 2)
        ranked = sorted(by_reason(findings, rows).items(), key=lambda reason: -len(reason[1]))
        yield Table(
            ["drives", "which", "reason"],
            [
                [number(len(names)), first_of(names, OF_ONE_REASON), reason]
                for reason, names in ranked[:NAMED]
            ],
            text_columns=(0, 1, 2),
            small=True,
        )
        if more := sum(len(names) for _, names in ranked[NAMED:]):
            yield note("further reasons", count=number(more))


def by_reason(findings: FleetFolder, rows: pd.DataFrame) -> dict[str, list[str]]:
    """Return the drives' names by their first loss, or by why they failed or have no score.

    The name of the drive's file, with which most reasons begin, is left out.
    """
    drives: defaultdict[str, list[str]] = defaultdict(list)
    for drive, row in zip(rows.index, records(rows), strict=True):
        first, *_ = (row["losses"] or row["reason"] or "no reason known").splitlines()
        begin, _, rest = first.partition(": ")
        is_file = rest and begin.rpartition("/")[2].startswith(row["name"])
        drives[rest if is_file else first].append(findings.names[drive])
    return drives


def strata(findings: FleetFolder) -> Iterator[Block]:
    """Yield, for each difference that has a plot, its mean for each value of each tag."""
    if findings.facts.strata:
        yield Heading("By tag")
    for effect, title in main_effects(findings):
        mask = (effect.base, effect.variant)
        parts = [part for part in findings.facts.strata if (part.base, part.variant) == mask]
        rows = [
            [
                "" if place and part.tag == parts[place - 1].tag else part.tag,
                part.value,
                number(part.difference.units),
                points(part.difference.mean),
                marked_interval(part.difference),
                *(number(n or 0) for n in (part.difference.worse, part.difference.better)),
            ]
            for place, part in enumerate(parts)
        ]
        titles = ["by", "value", "drives", "mean", "interval", "worse", "better"]
        table = Table(titles, rows, text_columns=(0, 1), breaks=breaks_of(rows), small=True)
        count = max((part.difference.comparisons or 0 for part in parts), default=0)
        name = "tested strata" if count else "untested strata"
        if parts:
            tested = caption(name, mark=MARK, count=count)
            yield Details(title, [table, note("strata", tested=tested)])


WORST_AT: Final = "#the-worst-frames-over-all-drives"
"""The address of the worst frames' heading on the page of a fleet."""
SEEN: Final = 12
"""Greatest number of pictures that a page shows at once."""
ACROSS: Final = 4
LONGEST: Final = 20
"""Greatest number of letters of a drive's name below a picture."""


def worst(findings: FleetFolder, across: int = ACROSS, most: int = SEEN) -> Iterator[Block]:
    """Yield at most ``most`` worst frames, with ``across`` pictures beside each other."""
    rows = records(findings.worst[:most])
    if not rows:
        return
    focus = findings.facts.focus
    yield Heading("The worst frames over all drives")
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
    limits = {"most": OF_A_DRIVE, "seconds": APART_NS / 1e9}
    legend = caption("worst frames of drives", variant=focus, errors=caption("errors"), **limits)
    if lacking := len(rows) - len(pictures):
        legend += f" {caption('missing pictures', pictures=counted(lacking, 'picture'))}"
    yield Text(legend, "note")
    yield Table(
        ["", "drive", "frame", "ERR, %", "in the viewer"],
        [
            [
                str(row["rank"]),
                findings.names[row["drive"]],
                str(row["frame"]),
                percent(row[TESTED]),
                findings.inspect(row),
            ]
            for row in rows
        ],
        text_columns=(0, 1, 2, 3, 4),
        small=True,
    )


def provenance(findings: FleetFolder) -> Iterator[Block]:
    """Yield the version that replayed many drives, and the files with the settings."""
    yield Heading("What was run")
    yield Text(caption("run of a fleet", version=findings.facts.version, folder=findings.path))
