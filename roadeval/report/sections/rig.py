"""The sections of a drive with several cameras: a table of all, and each camera's worst frame."""

from __future__ import annotations

from collections.abc import Iterator

from roadeval.data.words import short_names
from roadeval.report.blocks import Block, Details, Heading, KeepTogether, Text
from roadeval.report.findings import Findings
from roadeval.report.sections.frames import notable_frame
from roadeval.report.sections.slices import when_it_fails
from roadeval.report.tables import cameras_table, rates_table


def cameras(findings: Findings) -> Iterator[Block]:
    """Tabulate ERR of each camera's final masks, and the filter's effect."""
    yield Heading("Cameras")
    yield cameras_table(findings.facts)


def each_camera(findings: Findings) -> Iterator[Block]:
    """Yield the verdict, the rates and the worst frame of each camera."""
    names = short_names([*findings.cameras])
    for camera, of_camera in findings.cameras.items():
        facts = of_camera.facts
        yield Heading(f"Camera {names[camera]}")
        topic = camera if names[camera] != camera.strip("/") else ""
        size = f"{facts.drive.width} \N{MULTIPLICATION SIGN} {facts.drive.height}"
        yield Text(", ".join(filter(None, (topic, size))), "note")
        yield Text(facts.verdict)
        if facts.totals:
            yield Details("Rates of every final mask", [rates_table(facts)])
        yield from when_it_fails(of_camera, level=2)
        for frame in of_camera.worst[:1]:
            yield KeepTogether([*notable_frame(of_camera, frame)])
