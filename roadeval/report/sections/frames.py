"""The frames to look at: the worst, and those that the filter helped and harmed most."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from roadeval.data.words import listing, percent, points, timestamp
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.score import FILTER
from roadeval.report.blocks import (
    Block,
    Command,
    Heading,
    ImageGrid,
    KeepTogether,
    Table,
    Text,
    TwoColumns,
)
from roadeval.report.findings import Findings, NotableFrame
from roadeval.report.images import jpeg
from roadeval.report.sections.common import rate_cells, variant_cell

LARGE: Final = 420
SMALL: Final = 200
"""Pixels across the pictures of outcomes and of layers."""
LEAST: Final = 4
MOST: Final = 5
"""Pictures of outcomes that have room beside each other, at least and at most."""

NO_COMMAND: Final = (
    "No command opens them in the viewer, for the recording of this run is not where it was "
    "written; a report of the recording names one for each."
)


def section(findings: Findings) -> Iterator[Block]:
    """Yield the worst frames with all their layers, then those that the filter changed most."""
    first = next(iter(findings.finals))
    if not findings.worst:
        yield Heading("The worst frames")
        yield Text(f"ERR of {first} is undefined on every frame, so no frame is the worst.")
    rule = f"Highest ERR of {first}; of neighbouring frames only the worst."
    rows = (row for frame in findings.worst for row in frame.layers if row)
    if stepped := list(dict.fromkeys(row[0].title.partition(":")[0] for row in rows)):
        rule += f" Below the errors stand the steps of {listing(stepped)}, from left to right."
    head = [Heading("The worst frames"), Text(rule, "note")]
    if findings.commands and not findings.viewable:
        head.append(Text(NO_COMMAND, "note"))
    yield from _frames(findings, head, findings.worst)
    helped, harmed = (
        Heading(f"Frames that the filter {what} most", 2) for what in ("helped", "harmed")
    )
    yield from _frames(findings, [helped], findings.helped)
    yield from _frames(findings, [harmed], findings.harmed)


def _frames(
    findings: Findings, head: Sequence[Block], frames: Sequence[NotableFrame]
) -> Iterator[Block]:
    """Yield frames below a heading, which is on the page of the first of them."""
    for place, frame in enumerate(frames):
        yield KeepTogether([*(head if place == 0 else ()), *_frame(findings, frame)])


def _frame(findings: Findings, frame: NotableFrame) -> Iterator[Block]:
    stamp, *facts = sentences_about(frame)
    if frame.change is not None:
        facts = [f"The filter changes ERR by {points(frame.change)} pp."]
    elif frame.notes:
        facts[-len(frame.notes) :] = [" ".join(frame.notes)]
    sentences = [Text(sentence, "note") for sentence in (stamp, *facts)]
    rates = rates_of(frame, [*findings.finals])
    yield TwoColumns([Text(f"Frame {frame.frame}", "title"), *sentences], [rates], 0.55)
    if frame.images:
        pictures = [(image.title, jpeg(image, LARGE)) for image in frame.images]
        lines = -(-len(pictures) // MOST)
        yield ImageGrid(pictures, max(LEAST, -(-len(pictures) // lines)))
    columns = max((len(row) for row in frame.layers), default=0)
    for row in frame.layers:
        pictures = [(image.title, jpeg(image, SMALL)) for image in row]
        yield ImageGrid(pictures, columns, skip=columns - len(row))
    if findings.viewable and findings.commands:
        yield Command(findings.commands.inspect(frame.frame))


def rates_of(frame: NotableFrame, variants: Sequence[str]) -> Table:
    """Tabulate the rates of each variant's final mask; ``variants`` are all that were scored."""
    rows = [
        [variant_cell(name, variants), *rate_cells(rates, bold=name == frame.variant)]
        for name, rates in frame.rates.items()
    ]
    return Table(["final mask, %", *SHORT], rows, small=True)


def sentences_about(frame: NotableFrame) -> Iterator[str]:
    """Yield when it was, which stage its error comes from, and its notes."""
    yield f"Stamp {timestamp(frame.stamp_ns)}"
    if len(frame.parts) > 1:
        first, *rest = frame.parts
        terms = [f"{first} {percent(frame.parts[first])}"]
        terms += [f"{name} {points(frame.parts[name])}" for name in rest]
        culprit = max(frame.parts, key=lambda part: frame.parts[part])
        of = "the shadow filter" if culprit == FILTER else culprit
        yield f"ERR of {frame.variant}: {', '.join(terms)} pp. Most of it comes from {of}."
    yield from frame.notes
