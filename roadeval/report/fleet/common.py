"""Parts that reports of one fleet and of two share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from roadeval.data.words import interval, number, points
from roadeval.evaluation.stats import Stratum
from roadeval.report.blocks import Block, Cell, Table, Text
from roadeval.results.schema import LIGHT, TAG
from roadeval.results.sentences import MARK, stands

STRATA: Final = 30
"""Parts of a fleet that a table has, at most."""
_LIGHT: Final = {column.name for column in LIGHT}


@dataclass(frozen=True, slots=True)
class MarkedRow:
    """A part of a fleet in a table: by what, its value, and what changes there."""

    by: str
    value: str
    drives: int
    mean: float | None
    low: float | None
    high: float | None
    worse: int
    better: int
    stands: bool
    comparisons: int | None

    @classmethod
    def of_stratum(cls, stratum: Stratum) -> MarkedRow:
        """Return the row of a part of a comparison."""
        over = stratum.difference
        return cls(
            *(stratum.by, str(stratum.value), over.units, over.mean, over.low, over.high),
            *(over.worse or 0, over.better or 0, stands(over.p_holm, over.confidence)),
            over.comparisons,
        )

    @classmethod
    def of_dict(cls, told: Mapping[str, Any]) -> MarkedRow:
        """Return the row of a part in ``fleet.json``."""
        value = str(told["value"])
        if told["by"] in _LIGHT:
            value = f"{value} ({_number(told['least'])} to {_number(told['most'])})"
        return cls(
            *(told["by"].removeprefix(TAG), value),
            *(told["units"], told["mean"], told["low"], told["high"]),
            *(told["worse"], told["better"], stands(told["p_holm"], told["confidence"])),
            told["comparisons"],
        )


def strata_table(rows: Sequence[MarkedRow]) -> Iterator[Block]:
    """Yield a table of parts, those with the most drives of each division, and what marks mean."""
    shown = _largest(rows)
    kept: list[list[Cell | str]] = []
    breaks = []
    for place, row in enumerate(shown):
        first = place == 0 or shown[place - 1].by != row.by
        if first and place:
            breaks.append(place)
        mark = f" {MARK}" if row.stands else ""
        kept.append(
            [
                row.by if first else "",
                row.value,
                number(row.drives),
                Cell(points(row.mean), bold=row.stands),
                interval(row.low, row.high) + mark,
                number(row.worse),
                number(row.better),
            ]
        )
    yield Table(
        ["by", "value", "drives", "mean", "interval", "worse", "better"],
        kept,
        text_columns=(0, 1),
        breaks=breaks,
        small=True,
    )
    yield Text(_legend(rows, len(rows) - len(shown)), "note")


def _largest(rows: Sequence[MarkedRow]) -> list[MarkedRow]:
    """Keep the parts with the most drives, in the order given."""
    ranked = sorted(range(len(rows)), key=lambda place: (-rows[place].drives, place))[:STRATA]
    return [rows[place] for place in sorted(ranked)]


def _legend(rows: Sequence[MarkedRow], left_out: int) -> str:
    counts = {row.comparisons for row in rows if row.comparisons}
    told = "Percentage points, means over drives."
    if counts:
        told += (
            f" {MARK} stands after Holm's correction for the {max(counts)} parts that were "
            "tested together."
        )
    elif all(row.low is None for row in rows):
        told += " No part has enough drives, or groups of them, for an interval."
    if left_out:
        told += f" {left_out} smaller parts are left out."
    return told


def q_value(q: float) -> str:
    """Return a p-value as tables print it."""
    return "<0.001" if q < 0.001 else f"{q:.3f}"


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.2f}"
