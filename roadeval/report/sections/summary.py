"""The first page: the verdict, the table of rates, a few frames, and the warnings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from roadeval.data import BASELINE
from roadeval.data.words import defined, listing, number, percent
from roadeval.evaluation.metrics import FULL, METRICS, OVERLAP
from roadeval.report.blocks import (
    Block,
    BulletList,
    Cell,
    Heading,
    ImageGrid,
    PageBreak,
    Table,
    TableOfContents,
    Text,
    TwoColumns,
)
from roadeval.report.findings import Findings
from roadeval.report.images import jpeg
from roadeval.report.sections import seeds
from roadeval.report.sections.common import variant_cell

CROWDED: Final = 7
"""Rows of the tables and warnings together that leave room for all thumbnails."""
LOSSES: Final = 3
"""Losses that are named."""
PARTIAL: Final = (
    "This run did not reach its end: the report covers the part of the recording that can be read."
)


def section(findings: Findings) -> Iterator[Block]:
    """Yield the first page."""
    yield Heading("Summary")
    if not findings.complete:
        yield BulletList("Partial recording", [PARTIAL], "warning")
    yield Text(str(findings.summary["verdict"]), "verdict")
    if note := _how_sure(findings):
        yield Text(note, "note")
    if findings.totals:
        yield rates_table(findings)
        yield from seeds.blocks(findings)
    beware = list(warnings(findings))
    if findings.thumbnails:
        # A crowded page has room for one row of four only.
        rows = len(findings.finals) + len(seeds.rows(findings)) + len(beware)
        shown = findings.thumbnails[: 4 if rows > CROWDED else None]
        yield ImageGrid([(image.title, jpeg(image)) for image in shown], 4)
        yield Text(_legend(findings), "note")
    yield TwoColumns(
        [_accounting(findings.summary["frames"])],
        [
            BulletList("Beware", beware, "warning")
            if beware
            else BulletList("Beware", ["Nothing known."])
        ],
    )
    yield TableOfContents()
    yield PageBreak()


@dataclass(frozen=True, slots=True)
class _Column:
    """Numbers of the final masks, one a variant."""

    title: str
    values: Sequence[float | None]
    higher_is_better: bool

    def cells(self) -> Iterator[Cell]:
        """Yield the cells; that of the best value is bold."""
        known = [value for value in self.values if defined(value)]
        best = (max if self.higher_is_better else min)(known, default=None)
        place = None if best is None else self.values.index(best)
        yield from (Cell(percent(v), bold=i == place) for i, v in enumerate(self.values))


def rates_table(findings: Findings) -> Table:
    """Tabulate every final mask's rates; the best of each column is bold."""
    names = [*findings.finals]
    columns = list(_columns(findings))
    numbers = zip(*(column.cells() for column in columns), strict=True)
    return Table(
        ["final mask", "frames", *(column.title for column in columns)],
        [
            [variant_cell(name, names), number(findings.total(name)["frames"]), *row]
            for name, row in zip(names, numbers, strict=True)
        ],
        caption=(
            "Percent. The paper's rates are means over the evaluated frames; pooled ERR, IoU, F1 "
            f"and precision are of all pixels together.{_boundary_width(findings)} Bold: the best."
        ),
    )


def _columns(findings: Findings) -> Iterator[_Column]:
    finals = {name: findings.total(name) for name in findings.finals}
    for rate, metric in FULL.items():
        values = [total.get(rate) for total in finals.values()]
        yield _Column(rate, values, metric.higher_is_better)
    pooled = [total["pooled_ERR"] for total in finals.values()]
    yield _Column("pooled ERR", pooled, METRICS["ERR"].higher_is_better)
    overlap = [findings.overlap[name][stage] for name, stage in findings.finals.items()]
    for rate, metric in OVERLAP.items():
        yield _Column(rate, [each[rate] for each in overlap], metric.higher_is_better)
    if findings.beyond:
        boundary = [findings.beyond.get(name, {}).get("boundary_F") for name in finals]
        yield _Column("boundary F", boundary, higher_is_better=True)


def _boundary_width(findings: Findings) -> str:
    widths = {each["width"] for each in findings.beyond.values()}
    return f" Boundary F: the road's edge within {widths.pop()} pixels." if widths else ""


def _trained_here(placement: str) -> str:
    if placement == "spread":
        return (
            "Trained on frames spread along this drive (neither they nor those beside them are "
            "evaluated): the rates say how well it does between frames that were labelled."
        )
    return (
        "Trained on this drive's own first frames (none of them is evaluated): the rates say "
        "how well it does on a road that it has seen."
    )


def warnings(findings: Findings) -> Iterator[str]:
    """Yield what a reader must know before believing the numbers."""
    yield from map(str, findings.summary.get("warnings", ()))
    training = findings.summary.get("training", {})
    own = training.get("model") is None or training.get("adapted", False)
    if training.get("source") == "truth" and own and findings.totals:
        yield _trained_here(training.get("placement", "first"))
    yield from _worse_than_baseline(findings)
    yield from _undefined(findings)
    losses = list(findings.summary.get("losses", ()))
    yield from (f"Lost: {loss}" for loss in losses[:LOSSES])
    if len(losses) > LOSSES:
        yield f"{len(losses) - LOSSES} more frames were lost; summary.json names them."
    if not findings.pictured:
        yield "Made without pictures (a results folder holds none): no gallery, no maps."


def _worse_than_baseline(findings: Findings) -> Iterator[str]:
    """Yield a warning that names the variants with a higher ERR than the baseline."""
    blind = findings.total(BASELINE)["ERR"] if BASELINE in findings.finals else None
    if not defined(blind):
        return
    errors = {name: findings.total(name)["ERR"] for name in findings.finals}
    if worse := [name for name, error in errors.items() if defined(error) and error > blind]:
        yield (
            f"{listing(worse)} {'is' if len(worse) == 1 else 'are'} worse than {BASELINE} (ERR "
            f"{percent(blind)} %), which never looks at the image: nothing was gained from its "
            "pixels here."
        )


def _undefined(findings: Findings) -> Iterator[str]:
    for variant in findings.finals:
        total = findings.total(variant)
        frames, counts = total["frames"], total["undefined"].items()
        if never := [rate for rate, count in counts if count == frames]:
            yield f"{variant}: undefined on every frame: {listing(never)}."
        if many := [f"{rate} on {count}" for rate, count in counts if 0 < count < frames]:
            yield f"{variant}: undefined on some of {frames} frames, and left out: {listing(many)}."


def _how_sure(findings: Findings) -> str:
    changes = [pair.differences["ERR"] for pair in findings.paired]
    if not any(defined(change["low"]) for change in changes):
        return "The verdict concerns this drive only." if findings.totals else ""
    return (
        f"In brackets: {percent(changes[0]['confidence'], 0)} % intervals, which allow for "
        "neighbouring frames that resemble each other. Probably: by chance alone, one drive in ten "
        "would show as much in that direction. The verdict concerns this drive only."
    )


def _legend(findings: Findings) -> str:
    first = next(iter(findings.finals), None)
    if first is None:
        return "Green: called road."
    return (
        f"Errors of {first} across the drive. Green: road found; orange: non-road called road "
        "(FP); purple: road missed (FN); grey: ignored."
    )


def _accounting(frames: Mapping[str, Any]) -> Table:
    counts = {name: count for name, count in frames.items() if isinstance(count, int)}
    rows = [(name.replace("_", " "), count) for name, count in counts.items()]
    rows += [(f"skipped: {why}", count) for why, count in frames.get("skipped", {}).items()]
    return Table(["frames", "count"], [[name, number(count)] for name, count in rows], small=True)
