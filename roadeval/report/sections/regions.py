"""Where the errors are: by region, and as maps of the image."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from roadeval.data.words import percent
from roadeval.evaluation.regions import partitions, titles
from roadeval.report.blocks import Block, Figure, Heading, Table, Text
from roadeval.report.charts import rates
from roadeval.report.findings import Findings
from roadeval.report.sections.common import SIDE_BY_SIDE, sampled_frames

SHARES: Final = {"ERR": "ERR within, %", "errors": "share of its wrong pixels, %"}
"""Columns of `Findings.regions` that are tabulated for each variant, with their titles."""


def section(findings: Findings) -> Iterator[Block]:
    """Yield in which parts of the image the errors are."""
    yield Heading("Where the errors are")
    height = findings.facts.drive.height
    names = titles([*dict.fromkeys(region for region, _ in findings.regions)], height)
    yield Figure(
        rates.regions(findings.regions, [*findings.finals], names),
        "Error rate within each region, and the region's share of all wrong pixels beside its "
        "share of all pixels: a mark to the right of the grey bar is more than its share.",
    )
    together = len(findings.finals) <= SIDE_BY_SIDE
    for columns in [[*SHARES]] if together else [[column] for column in SHARES]:
        yield regions_table(findings, names, {column: SHARES[column] for column in columns})
    yield Text(_note(findings, names), "note")
    if findings.heatmaps:
        yield Figure(
            [*rates.heat(findings.heatmaps)],
            f"Where the final masks go wrong, over {sampled_frames(findings)}. FP: non-road called "
            "road; FN: road missed. Percent of the frames that label the pixel; grey: none does.",
        )


def regions_table(
    findings: Findings, names: Mapping[str, str], columns: Mapping[str, str]
) -> Table:
    """Tabulate the regions with their share of the pixels, and some columns for each variant.

    Parameters
    ----------
    findings
        Of the drive.
    names
        The regions' titles.
    columns
        Some of `SHARES`.
    """
    variants = [*findings.finals]
    found, order = findings.regions, [*names]
    return Table(
        ["region", "of all, %", *(name for _ in columns for name in variants)],
        [
            [
                title,
                percent(found[region, variants[0]]["pixels"], 1),
                *(percent(found[region, v][column], 1) for column in columns for v in variants),
            ]
            for region, title in names.items()
        ],
        # A rule above each family of regions that is the whole frame cut in another way.
        breaks=sorted({order.index(family[0]) for family in partitions(order)} - {0}),
        groups=[
            ("", 1),
            ("pixels", 1),
            *((title, len(variants)) for title in columns.values()),
        ],
        small=True,
    )


def _note(findings: Findings, names: Mapping[str, str]) -> str:
    width = findings.facts.run.get("evaluation", {}).get("boundary_width")
    near = f"within {width} pixels of" if width else "near"
    shadow = (
        "Shadow is what the filter took for shadow, right or wrong; where it is not true shadow, "
        "that is a finding of its own. "
    )
    return (
        f"{shadow if 'shadow' in names else ''}"
        f"Near the road's edge means {near} the border between road "
        "and non-road in the truth. Counts of all evaluated frames together; regions overlap."
    )
