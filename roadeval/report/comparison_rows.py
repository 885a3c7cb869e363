"""Parts that the tables of a comparison share."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from roadeval.data.words import interval
from roadeval.evaluation.comparison_result import (
    Disagreement,
    MaskComparison,
    MovedFrame,
    RegionComparison,
)
from roadeval.evaluation.uncertainty import Difference
from roadeval.results.certainty import MARK, stands

Row = MaskComparison | MovedFrame | RegionComparison | Disagreement
"""Something about a variant of a new result."""


def naming_columns(rows: Sequence[Row]) -> tuple[str, ...]:
    """Return the columns that name a row; without the result's, where the variants are that."""
    alone = all(row.result == row.variant for row in rows)
    return ("variant",) if alone else ("result", "variant")


def named(row: Row, names: Sequence[str]) -> list[str]:
    """Return the cells of these columns."""
    return [{"result": row.result, "variant": row.variant}[name] for name in names]


def breaks(rows: Sequence[Row]) -> list[int]:
    """Return the rows at which another result begins."""
    results = [row.result for row in rows]
    return [place for place, (above, own) in enumerate(pairwise(results), 1) if above != own]


def interval_of(change: Difference) -> str:
    """Return an interval, with a mark where the change stands after correction."""
    mark = f" {MARK}" if stands(change.p_holm, change.confidence) else ""
    return interval(change.low, change.high) + mark
