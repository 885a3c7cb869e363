"""Errors of masks in metres, for a known camera."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from roadeval.data import BASELINE, UNFILTERED
from roadeval.data.words import DASH, MINUS, defined, number, percent
from roadeval.evaluation.metres import ABOVE, FREE, LEFT, RIGHT
from roadeval.evaluation.metrics import TESTED
from roadeval.report.blocks import Block, Cell, Figure, Heading, Table, Text
from roadeval.report.captions import caption
from roadeval.report.charts import standard as charts
from roadeval.report.findings import Findings
from roadeval.report.tables import breaks_of, variant_cell
from roadeval.results.facts import Facts

METRES: Final = "metres: "
"""The beginning of the sentence on the source of the camera."""
UNSURE: Final = "\N{ALMOST EQUAL TO}"
"""The mark before a number that a small error of the camera's pose could explain."""
KITTI: Final = (("MaxF", "F1"), ("AP11", ""), ("precision",) * 2, ("recall",) * 2)
"""KITTI's measures, each with the one that replaces it for a mask without probabilities."""
Measure = Mapping[Any, Any]
"""A row of ``metres``."""


def on_the_ground(findings: Findings) -> Iterator[Block]:
    """Yield KITTI's rates; for a known camera also errors by distance, and the road's ends."""
    if findings.facts.kitti:
        yield Heading("KITTI's road benchmark")
        yield kitti_table(findings.facts)
    rows, names = findings.table("metres").to_dict("records"), [*findings.facts.finals]
    if not rows:
        return
    yield Heading("On the ground, in metres")
    confidence = percent(findings.facts.evaluation.confidence, 0)
    legend = caption("by distance", confidence=confidence)
    yield Figure([charts.by_distance(findings.by_distance, names)], legend)
    yield distance_table(rows, names)
    yield from edges_tables(rows, names)
    (source,) = (topic for topic in findings.facts.drive.topics if topic.startswith(METRES))
    flat = caption("camera", camera=source.removeprefix(METRES))
    effect = caption("posed camera" if _is_posed(rows) else "homography", unfiltered=UNFILTERED)
    yield Text(f"{flat} {effect}", "note")


def kitti_table(facts: Facts) -> Table:
    """Tabulate the rates of KITTI's road benchmark, by variant and category."""
    rates = "MaxF", "AP11", "precision", "recall", "FPR", "FNR"
    lines: list[list[Cell | str]] = [
        [
            variant_cell(variant, [*facts.finals]) if place == 0 else "",
            *(category, number(row["frames"])),
            *(percent(row.get(rate), 2) for rate in rates),
        ]
        for variant, rows in facts.kitti.items()
        for place, (category, row) in enumerate(rows.items())
    ]
    heads = ["variant", "images", "frames", "MaxF", "AP", "PRE", "REC", "FPR", "FNR"]
    return Table(heads, lines, (0, 1), breaks_of(lines), caption=caption("kitti"), small=True)


def distance_table(rows: Sequence[Measure], names: Sequence[str], *, brief: bool = False) -> Table:
    """Tabulate ERR by distance and by area of ground, and KITTI's measures over the ground.

    The row below a variant has the range of ERR for other poses of the camera, if it is known. A
    ``brief`` table has ERR alone.
    """
    places = list(dict.fromkeys(row["where"] for row in rows if row["measure"] == TESTED))
    measures = {(row["variant"], row["measure"], row["where"]): row for row in rows}
    variants = [name for name in names if (name, TESTED, places[0]) in measures]
    posed = _is_posed(rows)
    first = UNFILTERED if UNFILTERED in variants else variants[0]
    lines: list[list[Cell | str]] = []
    breaks, marked = [], False
    for variant in variants:
        breaks.append(len(lines))
        errors = [measures[variant, TESTED, place] for place in places]
        bases = [measures[first, TESTED, place] for place in places]
        marks = [
            UNSURE
            if variant != first and posed and _pose_effect(row) > abs(row["value"] - base["value"])
            else ""
            for row, base in zip(errors, bases, strict=True)
        ]
        marked |= any(marks)
        cells = [f"{m}{percent(row['value'], 1)}" for m, row in zip(marks, errors, strict=True)]
        for most, plain in () if brief else KITTI:
            row = measures.get((variant, most, ABOVE)) or measures.get((variant, plain, ABOVE), {})
            cells.append(percent(row.get("value"), 1))
        lines.append([variant_cell(variant, names), *cells])
        if defined(errors[0]["low"]):
            ranges = [f"{percent(r['low'], 1)}{DASH}{percent(r['high'], 1)}" for r in errors]
            lines.append(["range over poses", *ranges, *[""] * (0 if brief else len(KITTI))])
    heads = [charts.in_metres(place) for place in places if place != ABOVE]
    sentences = [caption("distances")]
    if not brief:
        sentences.append(caption("measures of distance"))
    elif marked:
        sentences.append(caption("unsure differences", first=first))
    return Table(
        ["ERR, %", *heads, "by area", *([] if brief else ["MaxF", "AP11", "prec.", "rec."])],
        lines,
        breaks=breaks[1:],
        groups=[("", 1), ("ahead", len(heads)), ("seen from above, %", 1 if brief else 5)],
        caption=" ".join(sentences),
        small=True,
    )


def _is_posed(rows: Sequence[Measure]) -> bool:
    """Return whether the errors were counted again for other poses of the camera."""
    return any(defined(row["low"]) for row in rows)


def _pose_effect(row: Measure) -> float:
    """Return how much a wrong pose can change a number; infinite if there may be no number."""
    if not defined(row["low"]):
        return math.inf
    return float(max(row["high"] - row["value"], row["value"] - row["low"]))


def edges_tables(rows: Sequence[Measure], names: Sequence[str]) -> Iterator[Table]:
    """Tabulate how far the edges and the end of the road in masks are from the truth's, in m."""
    measures = {(row["variant"], row["measure"], row["where"]): row for row in rows}
    places = list(dict.fromkeys(row["where"] for row in rows if row["measure"] == LEFT))
    variants = [name for name in names if name != BASELINE and (name, FREE, "ahead") in measures]
    posed = _is_posed(rows)
    lines: list[list[Cell | str]] = []
    for variant in variants:
        head: Cell | str = variant_cell(variant, names)
        for place in places:
            sides = [measures[variant, side, place] for side in (LEFT, RIGHT)]
            if any(row["frames"] for row in sides):
                cells = (cell for row in sides for cell in _end(row, posed=posed))
                lines.append([head, charts.in_metres(place), *cells])
                head = ""
    columns = ("median", "range", "95 %", "missing")
    if lines:
        yield Table(
            ["edges, m", "ahead", *columns, *columns],
            lines,
            breaks=breaks_of(lines),
            groups=[("", 2), ("left edge of the road", 4), ("right edge", 4)],
            caption=caption("edges"),
            small=True,
        )
    free = [measures[name, FREE, "ahead"] for name in variants]
    if any(row["frames"] for row in free):
        yield Table(
            ["free distance ahead, m", *columns],
            [[variant_cell(row["variant"], names), *_end(row, posed=posed)] for row in free],
            caption=caption("free distance"),
            small=True,
        )


def _end(row: Measure, *, posed: bool) -> tuple[str, str, str, str]:
    """Return the cells of an edge or end: median, range, 95th percentile, missing frames."""
    if not row["frames"]:
        return (DASH,) * 4
    unsure = posed and defined(row["value"]) and _pose_effect(row) > abs(row["value"])
    ends = (_metres(row[end]) for end in ("low", "high"))
    span = " to ".join(ends) if defined(row["low"]) else DASH
    median, size = f"{UNSURE * unsure}{_metres(row['value'])}", _metres(row["p95"]).lstrip("+")
    return median, span, size, f"{row['missing']} of {row['frames']}"


def _metres(value: float) -> str:
    if not defined(value):
        return DASH
    return f"{value:+.2f}".replace("-", MINUS) if round(value, 2) else "0.00"
