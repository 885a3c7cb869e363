"""What masks are worth in metres, where the camera is known."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from roadeval.data import BASELINE, UNFILTERED
from roadeval.data.words import DASH, MINUS, defined, percent
from roadeval.evaluation.metres import ABOVE, FREE, LEFT, RIGHT
from roadeval.evaluation.metrics import TESTED
from roadeval.report.blocks import Block, Cell, Figure, Heading, Table, Text
from roadeval.report.charts import standard as charts
from roadeval.report.findings import Findings
from roadeval.report.tables import variant_cell

METRES: Final = "metres: "
"""Begins the sentence on how the camera is known."""
UNSURE: Final = "\N{ALMOST EQUAL TO}"
"""Before a number that a wrong camera could explain."""
KITTI: Final = (("MaxF", "F1"), ("AP11", ""), ("precision",) * 2, ("recall",) * 2)
"""Measures of KITTI's benchmark, each with its counterpart of a mask without probabilities."""
Row = Mapping[Any, Any]


def on_the_ground(findings: Findings) -> Iterator[Block]:
    """Yield errors by distance, edges of the road and free distance; nothing without a camera."""
    rows, names = findings.table("metres").to_dict("records"), [*findings.finals]
    if not rows:
        return
    yield Heading("On the ground, in metres")
    yield Figure(
        [charts.by_distance(findings.by_distance, names)],
        "Error rate by distance ahead, means over the frames with "
        f"{percent(findings.facts.evaluation.confidence, 0)} % intervals, of this drive only.",
    )
    yield distance_table(rows, names)
    yield from edges_tables(rows, names)
    (known,) = (each for each in findings.facts.drive.topics if each.startswith(METRES))
    yield Text(f"The camera: {known.removeprefix(METRES)}. {_note(rows)}", "note")


def _note(rows: Sequence[Row]) -> str:
    told = "All of it holds on flat ground: a slope or a bump bends it."
    if _is_posed(rows):
        told += (
            " As the camera stands: the range if it looked 1\N{DEGREE SIGN} further up or down, or "
            f"stood 5 cm higher or lower, {DASH} where one of these would see none; {UNSURE}: that "
            f"alone could explain the number, or its difference from {UNFILTERED}."
        )
    else:
        told += " How far a wrong camera would move it is not known of a homography alone."
    return told


def distance_table(rows: Sequence[Row], names: Sequence[str], *, brief: bool = False) -> Table:
    """Tabulate ERR by distance and by area of ground, and what KITTI's benchmark measures there.

    Below each variant's row stands the range of a camera that stands otherwise, where it is known.
    A ``brief`` table has ERR alone.
    """
    errors = [row for row in rows if row["measure"] == TESTED]
    places = list(dict.fromkeys(row["where"] for row in errors))
    found = {(row["variant"], row["measure"], row["where"]): row for row in rows}
    variants = [name for name in names if (name, TESTED, places[0]) in found]
    posed = _is_posed(rows)
    first = UNFILTERED if UNFILTERED in variants else variants[0]
    lines: list[list[Cell | str]] = []
    breaks, marked = [], False
    for variant in variants:
        breaks.append(len(lines))
        own = [found[variant, TESTED, place] for place in places]
        bases = [found[first, TESTED, place] for place in places]
        effects = [abs(row["value"] - base["value"]) for row, base in zip(own, bases, strict=True)]
        marks = [
            UNSURE if variant != first and posed and _sway(row) > effect else ""
            for row, effect in zip(own, effects, strict=True)
        ]
        marked |= any(marks)
        cells = [f"{m}{percent(row['value'], 1)}" for m, row in zip(marks, own, strict=True)]
        for most, plain in () if brief else KITTI:
            row = found.get((variant, most, ABOVE)) or found.get((variant, plain, ABOVE), {})
            cells.append(percent(row.get("value"), 1))
        lines.append([variant_cell(variant, names), *cells])
        if defined(own[0]["low"]):
            ranges = [f"{percent(r['low'], 1)}{DASH}{percent(r['high'], 1)}" for r in own]
            lines.append(["as the camera stands", *ranges, *[""] * (0 if brief else len(KITTI))])
    heads = [charts.in_metres(each) for each in places if each != ABOVE]
    caption = (
        "Errors by distance, and on the ground seen from above, where each square metre counts once"
    )
    if not brief:
        caption += "; MaxF of a mask without probabilities is its F1; AP11: over eleven recalls"
    elif marked:
        caption += f". {UNSURE}: a camera that stands a little otherwise could explain the "
        caption += f"difference from {first}"
    return Table(
        ["ERR, %", *heads, "by area", *([] if brief else ["MaxF", "AP11", "prec.", "rec."])],
        lines,
        breaks=breaks[1:],
        groups=[("", 1), ("ahead", len(heads)), ("seen from above, %", 1 if brief else 5)],
        caption=f"{caption}.",
        small=True,
    )


def _is_posed(rows: Sequence[Row]) -> bool:
    """Return whether numbers were counted again as the camera might stand."""
    return any(defined(row["low"]) for row in rows)


def _sway(row: Row) -> float:
    """Return how far a wrong camera may move a number; infinitely where it may take it away."""
    if not defined(row["low"]):
        return math.inf
    return float(max(row["high"] - row["value"], row["value"] - row["low"]))


def edges_tables(rows: Sequence[Row], names: Sequence[str]) -> Iterator[Table]:
    """Tabulate how far edges of the road, and its end ahead, lie from those of the truth."""
    found = {(row["variant"], row["measure"], row["where"]): row for row in rows}
    places = list(dict.fromkeys(row["where"] for row in rows if row["measure"] == LEFT))
    variants = [name for name in names if name != BASELINE and (name, FREE, "ahead") in found]
    posed, breaks = _is_posed(rows), []
    lines: list[list[Cell | str]] = []
    for variant in variants:
        breaks.append(len(lines))
        for place in places:
            sides = [found[variant, side, place] for side in (LEFT, RIGHT)]
            if any(row["frames"] for row in sides):
                head = variant_cell(variant, names) if len(lines) == breaks[-1] else ""
                cells = (cell for row in sides for cell in _end(row, posed=posed))
                lines.append([head, charts.in_metres(place), *cells])
    columns = ("median", "as it stands", "95 %", "missing")
    if lines:
        yield Table(
            ["edges, m", "ahead", *columns, *columns],
            lines,
            breaks=breaks[1:],
            groups=[("", 2), ("left edge of the road", 4), ("right edge", 4)],
            caption="Mask minus truth, positive where the mask reaches too far outwards: the "
            "median, the 95th percentile of its size, and on how many of the frames on which the "
            "truth has an edge there the mask has none.",
            small=True,
        )
    free = [found[name, FREE, "ahead"] for name in variants]
    if any(row["frames"] for row in free):
        yield Table(
            ["free distance ahead, m", *columns],
            [[variant_cell(row["variant"], names), *_end(row, posed=posed)] for row in free],
            caption="How far ahead the road ends, mask minus truth; both at the latest where the "
            "truth is no longer known.",
            small=True,
        )


def _end(row: Row, *, posed: bool) -> tuple[str, str, str, str]:
    """Return the cells of a measure: its median, the range, the 95th percentile, the missing."""
    if not row["frames"]:
        return (DASH,) * 4
    unsure = posed and defined(row["value"]) and _sway(row) > abs(row["value"])
    known = defined(row["low"])
    span = f"{_metres(row['low'])} to {_metres(row['high'])}" if known else DASH
    size = _metres(row["p95"]).lstrip("+")
    return (
        f"{UNSURE * unsure}{_metres(row['value'])}",
        span,
        size,
        f"{row['missing']} of {row['frames']}",
    )


def _metres(value: float) -> str:
    if not defined(value):
        return DASH
    return f"{value:+.2f}".replace("-", MINUS) if round(value, 2) else "0.00"
