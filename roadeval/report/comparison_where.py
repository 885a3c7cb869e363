"""Where one of two methods is better: by region and shade, and where they disagree most."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Final

from roadeval.data.words import percent, points, timestamp
from roadeval.evaluation.comparison_result import Comparison
from roadeval.report.blocks import Block, Cell, Heading, Table, Text
from roadeval.report.comparison_rows import breaks, interval_of, named, naming_columns
from roadeval.results.certainty import correction

_REGIONS: Final = "ERR of the final masks, percent: means over the frames that label any of it."
_FRAMES: Final = "Percent of the labelled pixels that one of the two final masks has right alone."
_LEFT_OUT: Final = (
    "A region that is not the same pixels in both, as the shadow that another filter found, is "
    "left out. Frames with most shadow are a third, by the share of their pixels in true shadow, "
    "or in that which both detected."
)


def where(comparison: Comparison) -> Iterator[Block]:
    """Yield the tables under their headings, with what they mean."""
    if comparison.regions:
        legend = correction(asdict(row.difference) for row in comparison.regions)
        yield Heading("Where it is better, and where worse", 2)
        yield _region_table(comparison)
        yield Text(f"{legend} {_LEFT_OUT}".strip(), "note")
    if comparison.disagreements:
        yield Heading("Frames on which they disagree most", 2)
        yield disagreement_table(comparison)


def _region_table(comparison: Comparison) -> Table:
    rows = comparison.regions
    names = naming_columns(rows)
    return Table(
        [*names, "region, or frames", "frames", "base", "new", "difference", "interval"],
        [
            [
                *named(row, names),
                row.title,
                str(row.frames),
                percent(row.base),
                percent(row.new),
                Cell(points(row.difference.mean), bold=True),
                interval_of(row.difference),
            ]
            for row in rows
        ],
        text_columns=range(len(names) + 1),
        breaks=breaks(rows),
        caption=_REGIONS,
        small=True,
    )


def disagreement_table(comparison: Comparison) -> Table:
    """Tabulate the frames on which final masks disagree most, and which of them is right."""
    rows = comparison.disagreements
    names = naming_columns(rows)
    return Table(
        [*names, "frame", "stamp", "disagree", "base right", "new right"],
        [
            [
                *named(row, names),
                str(row.frame),
                timestamp(row.stamp_ns),
                Cell(percent(row.base_right + row.new_right), bold=True),
                percent(row.base_right),
                percent(row.new_right),
            ]
            for row in rows
        ],
        text_columns=[*range(len(names)), len(names) + 1],
        breaks=breaks(rows),
        caption=_FRAMES,
        small=True,
    )
