"""A fleet divided by its tags and by the light of its images."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from roadeval.data.words import interval, number, points
from roadeval.evaluation.stats import Difference
from roadeval.report.blocks import Block, Cell, Heading, Table, Text
from roadeval.report.findings import FleetFindings
from roadeval.report.sections.drives import plotted
from roadeval.results.facts import StratumFacts
from roadeval.results.schema import LIGHT, TAG
from roadeval.results.sentences import MARK, stands

STRATA: Final = 30
"""Parts of a fleet that a table has, at most."""
_LIGHT: Final = {column.name for column in LIGHT}


def section(findings: FleetFindings) -> Iterator[Block]:
    """Yield a table of parts for each difference that has a plot."""
    tables = []
    for effect, title in plotted(findings):
        mask = (effect.base, effect.variant)
        own = [each for each in findings.facts.strata if (each.base, each.variant) == mask]
        if own:
            tables.append((title, [Part(e.by.removeprefix(TAG), _value(e), e) for e in own]))
    if not tables:
        return
    yield Heading("By tag and by light")
    for title, rows in tables:
        yield Heading(title, 2)
        yield from strata_table(rows)
    yield Text(
        "Light is measured from the images: luminance and contrast from 0 to 1; shadow: the share "
        "of the lower half that is dark beside its lit part; sun: above 0 where shadows are bluer "
        "than what is lit. Each is divided into thirds of the drives.",
        "note",
    )


def _value(each: StratumFacts) -> str:
    """Return what the drives of a part share: a tag's value, or a third and its range."""
    if each.by not in _LIGHT:
        return each.value
    least, most = ("?" if end is None else f"{end:.2f}" for end in (each.least, each.most))
    return f"{each.value} ({least} to {most})"


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a fleet in a table: by what it is divided, the value there, and the difference."""

    by: str
    value: str
    difference: Difference

    @property
    def is_marked(self) -> bool:
        """Whether the difference stands after correction."""
        return stands(self.difference.p_holm, self.difference.confidence)


def strata_table(rows: Sequence[Part]) -> Iterator[Block]:
    """Yield a table of parts, those with the most drives of each division, and what marks mean."""
    ranked = sorted(range(len(rows)), key=lambda place: (-rows[place].difference.units, place))
    shown = [rows[place] for place in sorted(ranked[:STRATA])]
    first = [place == 0 or shown[place - 1].by != row.by for place, row in enumerate(shown)]
    yield Table(
        ["by", "value", "drives", "mean", "interval", "worse", "better"],
        [_cells(row, first=begins) for row, begins in zip(shown, first, strict=True)],
        text_columns=(0, 1),
        breaks=[place for place, begins in enumerate(first) if begins and place],
        small=True,
    )
    yield Text(_legend(rows, len(rows) - len(shown)), "note")


def _cells(row: Part, *, first: bool) -> list[Cell | str]:
    over, mark = row.difference, f" {MARK}" if row.is_marked else ""
    return [
        row.by if first else "",
        row.value,
        number(over.units),
        Cell(points(over.mean), bold=row.is_marked),
        interval(over.low, over.high) + mark,
        number(over.worse or 0),
        number(over.better or 0),
    ]


def _legend(rows: Sequence[Part], left_out: int) -> str:
    counts = {row.difference.comparisons for row in rows if row.difference.comparisons}
    legend = "Percentage points, means over drives."
    if counts:
        legend += (
            f" {MARK} stands after Holm's correction for the {max(counts)} parts that were "
            "tested together."
        )
    elif all(row.difference.low is None for row in rows):
        legend += " No part has enough drives, or groups of them, for an interval."
    if left_out:
        legend += f" {left_out} smaller parts are left out."
    return legend
