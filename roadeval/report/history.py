"""The report of a history for a terminal, Markdown, paper and a page."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Final

import numpy as np

from roadeval.data.arrays import Floats
from roadeval.data.words import BARS, DASH, counted, number, percent, points
from roadeval.evaluation.comparison.history import Line
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.regions import ALL
from roadeval.report import blocks
from roadeval.report.blocks import Block, BulletList, Cell, Details, Heading, Table, Text
from roadeval.report.captions import caption, note
from roadeval.report.chart import FAINT, WORSE, Chart, ChartKind, Look, Series, looks
from roadeval.report.comparison import limits
from roadeval.results.history import Event, History, describe_change, verdict
from roadeval.results.sentences import marked_interval

SPARKS: Final = 30
"""Greatest number of bars in the cell that shows a rate over the runs."""
ROWS: Final = 10
"""Greatest number of drives of an event, and of regions, classes and tags with a chart."""
Rows = list[list[Cell | str]]


def document(history: History) -> blocks.Report:
    """Return a history as a document."""
    runs = history.runs
    drives = counted(runs[-1].drives, "drive")
    lost = [BulletList("Left out", history.lost, "warning")] if history.lost else []
    columns, rows = ["run", "labels", "drives", "frames", "result"], list[Sequence[Cell | str]]()
    for run in reversed(runs):
        labels = ", ".join(f"{name}={value}" for name, value in run.origin.labels.items())
        rows.append([run.name, labels, number(run.drives), number(run.frames), run.paths[0]])
    return blocks.Report(
        kicker="roadeval history",
        title=f"{counted(len(runs), 'run')}: {history.focus}",
        subtitle=f"{runs[0].title} to {runs[-1].title}, {drives} in the last",
        footer=f"history of {history.focus}",
        blocks=[
            Heading("Since when"),
            Text(verdict(history), "verdict"),
            *limits(history.judgements),
            *lost,
            *(_details(history, event) for event in reversed(history.events)),
            note("steps"),
            Heading("Over the runs"),
            *_figures(history),
            Heading("All rates"),
            rates_table(sorted(history.lines, key=lambda line: line.variant != history.focus)),
            _drives_table(history),
            Heading("The runs"),
            Table(columns, rows, text_columns=(0, 1, 4), small=True, find="Find runs:"),
        ],
        keywords=["road recognition", "history"],
    )


def markdown(history: History) -> str:
    """Return a history as Markdown."""
    opened = (
        [Heading(block.title, 2), *block.blocks] if isinstance(block, Details) else [block]
        for block in document(history).blocks
    )
    return f"# roadeval history\n\n{blocks.blocks_as_markdown(chain.from_iterable(opened))}"


def rates_table(lines: Sequence[Line]) -> Table:
    """Tabulate each line's first and last rate, and bars for its levels over the runs."""
    rows = [[line.variant, line.title, *_over_runs(line.rates, line.levels)] for line in lines]
    columns = ["variant", "rate", "first %", "last %", "over the runs"]
    breaks = [n for n, row in enumerate(rows) if n and row[0] != rows[n - 1][0]]
    return Table(columns, rows, text_columns=(0, 1, 4), breaks=breaks, small=True)


def _over_runs(rates: Floats, levels: Floats) -> tuple[str, str, str]:
    """Return the first and the last defined rate, and bars from the least level to the greatest.

    If several runs share a bar, it shows their mean; a run without a level is a space.
    """
    defined = rates[~np.isnan(rates)]
    if not len(defined):
        return DASH, DASH, ""
    parts = [part[~np.isnan(part)] for part in np.array_split(levels, min(SPARKS, len(levels)))]
    means = np.array([part.mean() if len(part) else np.nan for part in parts])
    low, high = np.nanmin(means), np.nanmax(means)
    # If a rate does not change, all its bars are low, whatever the rounding.
    places = np.nan_to_num((means - low) / max(high - low, 1e-4) * (len(BARS) - 1)).round()
    bars = [" " if np.isnan(m) else BARS[int(p)] for m, p in zip(means, places, strict=True)]
    return percent(float(defined[0])), percent(float(defined[-1])), "".join(bars)


def _figures(history: History) -> Iterator[Block]:
    """Yield charts of the levels: of all pixels, then of the parts that changed most."""
    masks = [line for line in history.lines if line.kind == ALL]
    by_rate = {rate: [m for m in masks if m.rate == rate] for rate in (m.rate for m in masks)}
    yield blocks.Figure(
        [_chart(history, rate, lines) for rate, lines in by_rate.items()], caption("levels")
    )
    parts = [m for m in history.lines if m.kind != ALL and m.variant == history.focus and m.steps]
    parts.sort(key=lambda line: float(np.nanmin(line.levels) - np.nanmax(line.levels)))
    if parts:
        yield Heading(f"Where {history.focus} changed most", 2)
        yield blocks.Figure([_chart(history, line.title, [line]) for line in parts[:ROWS]], "")


def _chart(history: History, title: str, lines: Sequence[Line]) -> Chart:
    """Return a chart of the levels of ``lines`` over the runs, with their steps as marks."""
    by_variant, series = looks([line.variant for line in lines]), []
    places, names = range(len(history.runs)), [run.title for run in history.runs]
    for line in lines:
        ends = [(100 * end).tolist() for end in line.ends]
        level = (100 * line.levels).tolist()
        series.append(Series(line.variant, by_variant[line.variant], places, level, *ends))
        for step in line.steps:
            look = Look(WORSE if step.change > 0 else FAINT, mark="triangle")
            title_of_step = f"{step.kind} of {line.variant}, {names[step.run]}"
            series.insert(0, Series(title_of_step, look, [step.run], [level[step.run]]))
    return Chart(title, ChartKind.LINES, series, names=names, from_zero=False)


def _details(history: History, event: Event) -> Details:
    """Return an event's reasons, the rates, drives and frames that changed, and a command."""
    first, run = event.first, history.runs[event.run]
    parts: list[Block] = [BulletList("What changed there", event.reasons)]
    changes: Rows = [
        [c.line.variant, c.line.title, points(c.difference.mean), marked_interval(c.difference)]
        for c in event.changes
    ]
    columns = ["variant", "rate", "change", "interval"]
    parts.append(Table(columns, changes, text_columns=(0, 1), small=True))
    carrying = first.drives[first.drives["mean"] != 0].head(ROWS)
    drives: Rows = [
        [row["drive"], percent(row["before"]), percent(row["after"]), points(row["mean"])]
        for row in carrying.to_dict("records")
    ]
    title = f"{first.line.title} of the drives that changed most"
    columns = ["drive", "before %", "after %", "change"]
    parts.append(Table(columns, drives, caption=title, small=True))
    if event.frames:
        frames: Rows = [[drive, str(n), points(change)] for drive, n, change in event.frames]
        title = "Frames that changed most"
        parts.append(Table(["drive", "frame", "change of ERR"], frames, caption=title, small=True))
    paths = [history.runs[place].paths[0] for place in (event.before, event.run)]
    parts.append(blocks.Command(shlex.join(["roadeval", "compare", *paths])))
    return Details(f"{run.name}: {describe_change(first)}", parts)


def _drives_table(history: History) -> Details:
    """Return a table of the error rate of the focus on each drive, over the runs."""
    import pandas as pd

    rows: Rows = []
    for line in history.lines:
        if (line.variant, line.kind, line.rate) == (history.focus, ALL, TESTED):
            by_drive = pd.DataFrame(line.drive_rates.T).groupby(line.drives["drive"].to_numpy())
            for drive, rates in by_drive.mean().iterrows():
                rows.append([str(drive), *_over_runs(rates.to_numpy(), rates.to_numpy())])
    columns = ["drive", "first %", "last %", "over the runs"]
    table = Table(columns, rows, text_columns=(0, 3), small=True, find="Find drives:")
    return Details(f"{TESTED} of {history.focus} on each drive", [table], on_paper=False)
