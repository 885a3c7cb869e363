"""Several cameras of one drive: a table of all, and each one's worst frame."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from roadeval.data.words import DASH, MINUS, number, points, short_names
from roadeval.report.blocks import Block, Cell, Details, Heading, KeepTogether, Table, Text
from roadeval.report.findings import Findings
from roadeval.report.sections import summary
from roadeval.report.sections.frames import notable_frame
from roadeval.results.sentences import marked_interval


def cameras(findings: Findings) -> Iterator[Block]:
    """Yield a row for each camera: ERR of the final masks, and what the filter changes."""
    yield Heading("Cameras")
    found = findings.cameras
    names, masks = short_names([*found]), [*findings.finals]
    finals = [each for each in findings.facts.effects if each.final][:1]
    pairs = [(each.variant, each.base) for each in finals]
    rows: list[list[Cell | str]] = []
    for camera, own in found.items():
        errors = [own.total(name)["ERR"] if name in own.finals else None for name in masks]
        changes = {(e.variant, e.base): e.rates["ERR"] for e in own.facts.effects if e.final}
        row: list[Cell | str] = [names[camera], number(own.facts.frames.evaluated)]
        for pair in pairs:
            change = changes.get(pair)
            row += [points(change.mean), marked_interval(change)] if change else [DASH, DASH]
        rows.append([*row[:2], *summary.best_bold(errors, higher=False), *row[2:]])
    titles = [title for a, b in pairs for title in (f"{a} {MINUS} {b}", "interval")]
    yield Table(
        ["camera", "frames", *masks, *titles],
        rows,
        caption="ERR of the final masks in percent, and its difference in percentage points with "
        "the interval within the camera. Above, each camera counts the same, and frames that were "
        "taken at the same time count once in an interval.",
        small=True,
    )


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
            yield Details("Rates of every final mask", [summary.rates_table(own)])
        for frame in islice(own.worst, 1):
            yield KeepTogether([*notable_frame(own, frame)])
