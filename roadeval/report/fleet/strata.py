"""Where it differs: the fleet divided by its tags and by the light of its images."""

from __future__ import annotations

from collections.abc import Iterator

from roadeval.report.blocks import Block, Heading, Text
from roadeval.report.fleet.common import MarkedRow, strata_table
from roadeval.report.fleet.drives import plotted
from roadeval.report.fleet.findings import FleetFindings


def section(findings: FleetFindings) -> Iterator[Block]:
    """Yield a table of parts for each difference that has a plot."""
    tables = []
    for told, title in plotted(findings):
        rows = [
            MarkedRow.of_dict(each)
            for each in findings.summary["strata"]
            if (each["base"], each["variant"]) == (told["base"], told["variant"])
        ]
        if rows:
            tables.append((title, rows))
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
