"""The worst frames over all drives, with their pictures."""

from __future__ import annotations

from collections.abc import Iterator

from roadeval.data.words import percent
from roadeval.report.blocks import Block, Heading, ImageGrid, Text
from roadeval.report.fleet.findings import FleetFindings, WorstFrame

ACROSS = 4
LONGEST = 20
"""Letters of a drive's name below a picture."""


def section(findings: FleetFindings) -> Iterator[Block]:
    """Yield the worst frames."""
    if not findings.worst:
        return
    yield Heading("The worst frames over all drives")
    pictures = [
        (_caption(findings, frame, place), frame.picture)
        for place, frame in enumerate(findings.worst, 1)
        if frame.picture is not None
    ]
    if pictures:
        yield ImageGrid(pictures, ACROSS)
    yield Text(_note(findings, len(pictures)), "note")


def _caption(findings: FleetFindings, frame: WorstFrame, place: int) -> str:
    name = findings.names[frame.drive]
    if len(name) > LONGEST:
        name = f"{name[: LONGEST // 2]}\N{HORIZONTAL ELLIPSIS}{name[1 - LONGEST // 2 :]}"
    return f"{place}. {name}, frame {frame.frame}: ERR {percent(frame.rates['ERR'], 1)} %"


def _note(findings: FleetFindings, shown: int) -> str:
    missing = len(findings.worst) - shown
    told = (
        "By ERR of the first variant's final mask; of a drive at most three, a second apart. "
        "Green: road found; orange: non-road called road (FP); purple: road missed (FN); "
        "grey: ignored."
    )
    if missing:
        others = ", ".join(
            f"{findings.names[frame.drive]} frame {frame.frame}"
            for frame in findings.worst
            if frame.picture is None
        )
        told += f" Pictures of {missing} are not in the folder: {others}."
    return told
