"""Masks without truth: what they look like, and how much of the image they cover."""

from __future__ import annotations

from collections.abc import Iterator

from roadeval.report.blocks import Block, Figure, Heading, ImageGrid, Text
from roadeval.report.charts.rates import coverage
from roadeval.report.findings import Findings
from roadeval.report.images import variants_of
from roadeval.report.sections.common import example_pictures


def section(findings: Findings) -> Iterator[Block]:
    """Yield what there is to see without truth."""
    yield Heading("Masks")
    yield Text(
        "Without truth nothing can be said about errors: not whether the road was found, not "
        "whether the filter helps, not which stage is at fault. What follows is what was computed."
    )
    if findings.examples:
        pictures = list(example_pictures(findings.examples))
        yield ImageGrid(pictures, len(variants_of(findings.examples)) + 1)
    if findings.coverage:
        yield Figure(
            [coverage(findings.coverage)],
            "The share of the image that the final masks call road. A jump is worth a look.",
        )
