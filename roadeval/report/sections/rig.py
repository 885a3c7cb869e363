"""Several cameras of one drive: a table of all, and each one's worst frame."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from roadeval.data.words import short_names
from roadeval.report.blocks import Block, Details, Heading, KeepTogether, Text
from roadeval.report.findings import Findings
from roadeval.report.sections.frames import notable_frame
from roadeval.report.tables import cameras_table, rates_table


def cameras(findings: Findings) -> Iterator[Block]:
    """Yield a row for each camera: ERR of the final masks, and what the filter changes."""
    yield Heading("Cameras")
    yield cameras_table(findings.facts)


def each_camera(findings: Findings) -> Iterator[Block]:
    """Yield what there is to say of each camera: its verdict, its rates, and its worst frame."""
    names = short_names([*findings.cameras])
    for camera, own in findings.cameras.items():
        yield Heading(f"Camera {names[camera]}")
        told = camera if names[camera] != camera.strip("/") else ""
        size = f"{own.facts.drive.width} \N{MULTIPLICATION SIGN} {own.facts.drive.height}"
        yield Text(", ".join(filter(None, (told, size))), "note")
        yield Text(own.facts.verdict)
        if own.totals:
            yield Details("Rates of every final mask", [rates_table(own.facts)])
        for frame in islice(own.worst, 1):
            yield KeepTogether([*notable_frame(own, frame)])
