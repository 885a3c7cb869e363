"""The worst frames over all drives, with their pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from roadeval.data.words import percent
from roadeval.report.blocks import Block, Cell, Heading, ImageGrid, Table, Text
from roadeval.report.findings import FleetFindings, WorstPicture
from roadeval.runtime.text import elided

ACROSS = 4
LACKING = 12
"""Frames without a picture that are named."""
LONGEST = 20
"""Letters of a drive's name below a picture."""


def section(findings: FleetFindings) -> Iterator[Block]:
    """Yield the worst frames."""
    if not findings.worst:
        return
    yield Heading("The worst frames over all drives")
    pictures = [
        (_caption(findings, frame), frame.picture)
        for frame in findings.worst
        if frame.picture is not None
    ]
    if pictures:
        yield ImageGrid(pictures, ACROSS)
    yield Text(_legend(findings, len(pictures)), "note")
    if findings.inspect is not None:
        yield commands_table(findings, findings.inspect)


def commands_table(findings: FleetFindings, inspect: Callable[[int], str]) -> Table:
    """Tabulate the worst frames with the command that opens each in the viewer."""
    pages = findings.pages()
    return Table(
        ["", "drive", "frame", "ERR, %", "in the viewer"],
        [
            [
                str(frame.rank),
                Cell(findings.names[frame.drive], leads=pages[frame.drive]),
                Cell(
                    str(frame.frame),
                    leads=f"{pages[frame.drive]}#frame-{frame.frame}",
                ),
                Cell(percent(frame.rates["ERR"]), bold=True),
                Cell(inspect(frame.rank), opens=f"worst/{frame.rank}"),
            ]
            for frame in findings.worst
        ],
        text_columns=(0, 1, 4),
        small=True,
    )


def _caption(findings: FleetFindings, frame: WorstPicture) -> str:
    name = elided(findings.names[frame.drive], LONGEST)
    return f"{frame.rank}. {name}, frame {frame.frame}: ERR {percent(frame.rates['ERR'], 1)} %"


def _legend(findings: FleetFindings, shown: int) -> str:
    missing = len(findings.worst) - shown
    legend = (
        "By ERR of the first variant's final mask; of a drive at most three, a second apart. "
        "Green: road found; orange: non-road called road (FP); purple: road missed (FN); "
        "grey: ignored."
    )
    if missing:
        lacking = [frame for frame in findings.worst if frame.picture is None]
        named = [f"{findings.names[each.drive]} frame {each.frame}" for each in lacking[:LACKING]]
        more = f" and {missing - LACKING} more" if missing > LACKING else ""
        legend += f" Pictures of {missing} are not in the folder: {', '.join(named)}{more}."
    return legend
