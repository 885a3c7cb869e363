"""The report of a comparison for a terminal, a pull request (Markdown), paper and a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from itertools import groupby, pairwise
from operator import attrgetter
from typing import Any, Final

from roadeval.data.words import DASH, interval, listing, number, percent, points, timestamp
from roadeval.evaluation.comparison import compare
from roadeval.evaluation.comparison.compare import Comparison, MaskChange
from roadeval.evaluation.comparison.conditions import Judgement
from roadeval.evaluation.comparison.pairing import MovedFrame
from roadeval.evaluation.metrics import SHORT, TESTED
from roadeval.report import blocks
from roadeval.report.blocks import Block, BulletList, Cell, Heading, Table, Text
from roadeval.report.captions import caption
from roadeval.report.chart import Chart
from roadeval.report.charts import standard as charts
from roadeval.report.comment import MOST, changes, fit, in_code, levels, standing
from roadeval.report.tables import breaks_of
from roadeval.results import comparison as sentences
from roadeval.results.sentences import correction, marked_interval

Inspect = Callable[[str, int], str]
Row = MaskChange | MovedFrame | compare.RegionChange | compare.DriveChange | compare.ClassChange
"""A fact about a variant of a new result."""
Columns = dict[str, Callable[[Any], Cell | str]]
"""The functions that make the cells of a row, by the titles of the columns."""
NAMED: Final = 20
"""Greatest number of drives in the table of a mask's changed drives."""
CHANGE: Final = ("base %", "new %", "change", "interval")
"""The titles of a change's columns."""
_COMMAND: Final = "in the viewer"
_MASK: Final = attrgetter("result", "variant")
_WORDS: Final = ("result", "variant", "stage", "rate", "drive", "region", "stamp", "class")
"""The columns of words, beside the commands."""


def document(
    comparison: Comparison,
    judgements: Sequence[Judgement],
    over_drive: Sequence[Chart],
    inspect: Inspect | None = None,
) -> blocks.Report:
    """Return a comparison as a document.

    ``judgements`` judge the limits of the command; ``over_drive`` has charts of the masks' rates
    over the drive, or none; ``inspect`` returns the command that opens a frame of the result with
    a label, and None leaves the commands out.
    """
    labels = [result.label for result in comparison.results]
    sizes = [
        f"{result.label}: {number(result.scored)} of {number(result.drives)} drives scored"
        if result.drive is None
        else f"{result.label}: {result.frames} frames of {result.drive}"
        for result in comparison.results
    ]
    figures: list[Block] = []
    if finals := [row for row in _changed(comparison) if row.final]:
        figures.append(blocks.Figure(charts.changes(finals), caption("change of rates")))
    if over_drive:
        figures.append(Heading("Over the drive", 2))
        figures.append(blocks.Figure(over_drive, caption("common frames", rate=TESTED)))
    return blocks.Report(
        kicker="roadeval comparison",
        title=listing(labels),
        subtitle="; ".join(sizes),
        footer=f"comparison of {listing(labels)}",
        blocks=[
            Heading("What changed"),
            *overview(comparison, judgements),
            *_warnings(comparison),
            *figures,
            *_details(comparison, inspect),
        ],
        keywords=["road recognition", "comparison"],
    )


def markdown(comparison: Comparison, judgements: Sequence[Judgement]) -> str:
    """Return a comparison as Markdown."""
    parts = [*overview(comparison, judgements), *_warnings(comparison), *_details(comparison)]
    title = "roadeval comparison"
    if judgements:
        exceeded = [judgement.holds for judgement in judgements]
        title = f"roadeval: {sentences.headline(exceeded)}"
    return f"# {title}\n\n{blocks.blocks_as_markdown(parts)}"


def comment(
    comparison: Comparison, judgements: Sequence[Judgement], over: Sequence[Chart], command: str
) -> str:
    """Return a comparison as the Markdown of one comment; ``command`` makes it again."""
    mask, text, head = standing(comparison, judgements)
    if judgements:
        failed = [limit.condition.text for limit in judgements if limit.holds is not False]
        head = ": ".join([sentences.headline([j.holds for j in judgements]), *failed[:1]])
    chief = replace(comparison, changes=tuple(comparison.finals()))
    for kind in ("drives", "regions", "moved"):
        rows: Any = tuple(row for row in getattr(chief, kind) if _MASK(row) == _MASK(mask))
        chief = replace(chief, **{kind: rows})
    first = [Heading(f"roadeval: {head}; ERR of {text}"), *overview(chief, judgements, 10)]
    texts = [*map(fit, (first, changed_drives(chief, 10), _warnings(comparison)))]
    base, name = chief.results[0].label, mask.variant
    lines = {line.name: line.y for chart in over for line in chart.series}
    old = lines.get(base if name == mask.result else f"{base}: {name}", [])
    pairs = [*zip(old, lines.get(mask.name, []), strict=False)]
    pairs = pairs or sorted(((100 * d.base, 100 * d.new) for d in chief.drives), reverse=True)
    where = "over the drive" if old else "drive by drive"
    drawn = {f"ERR of {name}, {where}: bars are {base}, the line is {mask.result}.": levels(pairs)}
    for unit, moves in {
        "region": [(row.title, row.difference.mean) for row in chief.regions],
        "drive": [(row.drive, row.difference.mean) for row in chief.drives],
        "frame": [(f"frame {row.frame}", row.change) for row in chief.moved],
    }.items():
        drawn[f"Change of {name} by {unit}: orange is worse, blue is better."] = changes(moves)
    texts += [f"{fit([Text(sentence)])}\n{chart}" for sentence, chart in drawn.items() if chart]
    texts.append(f"Again: {in_code(command)}\n")
    rest = {"Stages": _changes(comparison), "Regions": _details(replace(comparison, drives=()))}
    for title, part in rest.items():
        inside = fit(part, MOST - len("\n".join(texts).encode()) - 200)
        texts.append(f"<details><summary>{title}</summary>\n\n{inside}\n</details>\n")
    return "\n".join(text for text in texts if text.strip())


def _warnings(comparison: Comparison) -> Iterator[Block]:
    if comparison.warnings:
        yield BulletList("Beware", comparison.warnings, "warning")


def overview(
    comparison: Comparison, judgements: Sequence[Judgement], most: int | None = None
) -> Iterator[Block]:
    """Yield the limits, the verdict, changed settings, all rates, and where masks differ.

    ``judgements`` judge the limits of the command; at most ``most`` changed settings are named.
    """
    yield from limits(judgements)
    yield Text(sentences.verdict(comparison), "verdict")
    yield from (Text(line) for line in sentences.changed_settings(comparison, most))
    yield from _changes(comparison)
    if where := sentences.where(comparison):
        yield BulletList("Where", where)


def limits(judgements: Sequence[Judgement]) -> Iterator[Block]:
    """Yield the limits of a command: first the exceeded, then the unjudged, then the kept ones."""
    for title, kind, tone in (
        ("Limits exceeded", True, "warning"),
        ("Not judged", None, "warning"),
        ("Limits kept", False, "plain"),
    ):
        alike = [limit for limit in judgements if limit.holds is kind]
        if lines := [sentences.describe_judgement(limit) for limit in alike]:
            yield BulletList(title, lines, tone)


def _changes(comparison: Comparison) -> Iterator[Block]:
    """Yield a table for each result: ERR of each stage, and every rate of the final masks."""
    base = comparison.results[0].label
    alone = all(row.result == row.variant for row in comparison.changes)
    changed = _changed(comparison)
    for result, group in groupby(changed, lambda row: "" if alone else row.result):
        rows = [*group]
        drives = max(row.drives for row in rows)
        over = f": {drives} drives in common" if drives > 1 else ""
        lines: list[list[Cell | str]] = []
        for variant, of_variant in groupby(rows, attrgetter("variant")):
            for place, row in enumerate(of_variant):
                for rate in SHORT if row.final else [TESTED]:
                    first, change = rate == TESTED, row.difference[rate]
                    mask = variant if first and place == 0 else "", row.stage if first else ""
                    rates = percent(row.base[rate]), percent(row.new[rate])
                    lines.append(
                        [*mask, rate, *rates, points(change.mean), marked_interval(change)]
                    )
        yield Table(
            ["variant", "stage", "rate", *CHANGE],
            lines,
            text_columns=(0, 1, 2),
            breaks=breaks_of(lines),
            caption=f"{result} against {base}{over}".strip(),
            small=True,
        )
    means = caption("means over drives" if comparison.drives else "means over frames")
    yield Text(f"{means} {caption('a change')}", "note")
    if legend := correction(row.difference[TESTED] for row in comparison.changes):
        yield Text(legend, "note")


def _changed(comparison: Comparison) -> list[MaskChange]:
    """Return the changes to show, without the variants that changed in no stage."""
    names = {(row.result, row.variant) for row in comparison.changes if not row.unchanged}
    return [row for row in comparison.changes if (row.result, row.variant) in names]


def _table(rows: Sequence[Row], columns: Columns, legend: str = "") -> Table:
    """Tabulate rows: the result, unless there is only one, the variant, and ``columns``.

    A rule separates the rows of different results.
    """
    names: Columns = {"result": lambda row: row.result, "variant": lambda row: row.variant}
    results = [row.result for row in rows]
    if len(set(results)) == 1 or all(row.result == row.variant for row in rows):
        del names["result"]
    columns = names | columns
    return Table(
        [*columns],
        [[cell(row) for cell in columns.values()] for row in rows],
        text_columns=[p for p, title in enumerate(columns) if title in (*_WORDS, _COMMAND)],
        breaks=[place for place, (a, b) in enumerate(pairwise(results), 1) if a != b],
        caption=legend,
        small=True,
    )


def _details(comparison: Comparison, inspect: Inspect | None = None) -> Iterator[Block]:
    """Yield the drives that changed, and the regions and frames on which masks differ."""
    if comparison.drives:
        yield Heading("Which drives changed")
        yield Text(sentences.DISCOVERY, "note")
        yield from _plot(comparison)
        yield from changed_drives(comparison)
    if comparison.regions:
        changes = [row.difference for row in comparison.regions]
        why = sentences.why_unsure(changes)
        legend = correction(changes) or f"{why[:1].upper()}{why[1:]}."
        yield Heading("Where it is better, and where worse", 2)
        if rows := [row for row in comparison.regions if not row.difference.is_zero]:
            columns: Columns = {
                "region": lambda row: row.title,
                "frames": lambda row: str(row.frames),
                **_change(lambda row: marked_interval(row.difference)),
            }
            yield _table(rows, columns, caption("regions of a comparison"))
        unchanged = "" if len(rows) == len(comparison.regions) else "regions without a change"
        notes = [caption(name) for name in (unchanged, "regions left out") if name]
        yield Text(" ".join(filter(None, [legend, *notes])), "note")
    if comparison.classes:
        yield Heading("What is taken for road", 2)
        columns = {
            "class": lambda row: row.name,
            "base %": lambda row: percent(row.base),
            "new %": lambda row: percent(row.new),
            "change pp": lambda row: points(row.new - row.base),
        }
        yield _table(comparison.classes, columns, caption("classes of a comparison"))
    if comparison.moved:
        yield Heading("Frames that changed most", 2)
        columns = {
            "frame": lambda row: str(row.frame),
            "stamp": lambda row: timestamp(row.stamp_ns),
            "ERR base": lambda row: percent(row.base),
            "new": lambda row: percent(row.new),
            "difference": lambda row: points(row.change),
        }
        if inspect:
            columns[_COMMAND] = lambda row: inspect(row.result, row.frame)
        yield _table(comparison.moved, columns)


def changed_drives(comparison: Comparison, most: int = NAMED) -> Iterator[Block]:
    """Yield, for each mask, a table of the drives that changed, the surest first."""
    for (result, variant), drives in groupby(comparison.drives, _MASK):
        if rows := [row for row in drives if row.changed]:
            shown = f" ({most} of {len(rows)})" if len(rows) > most else ""
            of = f" of {result}" if len(comparison.results) > 2 else ""
            title = f"{variant}{of} changed"
            if result == variant:  # variants of one result
                title = f"{variant} differs from {comparison.results[0].label}"
            yield Heading(f"Drives on which {title}{shown}, the surest first", 2)
            columns: Columns = {
                "drive": lambda row: row.drive,
                "frames": lambda row: number(row.frames),
                **_change(lambda row: interval(row.difference.low, row.difference.high)),
                "q": lambda row: (
                    DASH if row.q is None else "<0.001" if row.q < 0.001 else f"{row.q:.3f}"
                ),
            }
            yield _table(rows[:most], columns)


def _change(ends: Callable[[Any], str]) -> Columns:
    """Return the columns of a change of ERR; ``ends`` returns the text of its interval."""
    cells: tuple[Callable[[Any], Cell | str], ...] = (
        lambda row: percent(row.base),
        lambda row: percent(row.new),
        lambda row: points(row.difference.mean),
        ends,
    )
    return dict(zip(CHANGE, cells, strict=True))


def _plot(comparison: Comparison) -> Iterator[Block]:
    """Yield a chart of the change of the first mask on every drive."""
    import pandas as pd

    mask, group = next(groupby(comparison.drives, _MASK))
    drives = [(row.drive, asdict(row.difference)) for row in group if row.difference.units]
    if drives:
        rows = pd.DataFrame([{"name": name, "group": "", **change} for name, change in drives])
        final = next(row for row in comparison.changes if row.final and _MASK(row) == mask)
        over = final.difference[TESTED]
        yield charts.forest(rows, over, f"change of {TESTED} of {final.variant}")
