"""The frames to look at: the worst, and those that the filter helped and harmed most."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from typing import Final

from roadeval.report.blocks import (
    Block,
    Cell,
    Columns,
    Command,
    Heading,
    Strip,
    Table,
    Text,
    Together,
)
from roadeval.report.findings import Case, Findings
from roadeval.report.pictures import asset
from roadeval.report.sections.front import variant_cell
from roadeval.report.sections.reasons import FILTER
from roadeval.report.words import moment, percent, points

LARGE: Final = 420
SMALL: Final = 200


def gallery(found: Findings) -> Iterator[Block]:
    """Show the worst frames with all their layers, then those that the filter moved most."""
    first = next(iter(found.finals))
    if not found.worst:
        yield Heading("The worst frames")
        yield Text(f"ERR of {first} is undefined on every frame, so no frame is the worst.")
    rule = Text(
        f"Highest ERR of {first}; of neighbouring frames only the worst. "
        "Below the errors stand each variant's steps, from left to right.",
        "note",
    )
    yield from _cards(found, [Heading("The worst frames"), rule], found.worst)
    yield from _cards(found, [Heading("Frames that the filter helped most", 2)], found.helped)
    yield from _cards(found, [Heading("Frames that the filter harmed most", 2)], found.harmed)


def _cards(found: Findings, head: Sequence[Block], cases: Sequence[Case]) -> Iterator[Block]:
    """Show frames below a heading that stays with the first of them."""
    cards = [list(_card(found, case)) for case in cases]
    for place, card in enumerate(cards):
        yield Together([*head, *card] if place == 0 else card)


def culprit(case: Case) -> str:
    """Name the stage with the greatest part in a frame's error."""
    name = max(case.parts, key=lambda part: case.parts[part])
    return "the shadow filter" if name == FILTER else name


def command(found: Findings, frame: int) -> str:
    """Give the command that opens the viewer at a frame."""
    return f"roadeval inspect {shlex.quote(found.source)} --frame {frame}"


def _card(found: Findings, case: Case) -> Iterator[Block]:
    rates = Table(
        ["<final mask, %", "ERR", "FPR", "FNR"],
        [
            [
                variant_cell(name, [*found.finals]),
                Cell(percent(rates["ERR"]), bold=name == case.variant),
                percent(rates["FPR"]),
                percent(rates["FNR"]),
            ]
            for name, rates in case.rates.items()
        ],
        small=True,
    )
    words = [Text(sentence, "note") for sentence in _said(case)]
    yield Columns([Text(f"Frame {case.frame}", "title"), *words], [rates], 0.55)
    if case.shots:
        yield Strip([(shot.title, asset(shot, LARGE)) for shot in case.shots], 4)
    columns = max((len(row) for row in case.rows), default=0)
    for row in case.rows:
        pictures = [(shot.title, asset(shot, SMALL)) for shot in row]
        yield Strip(pictures, columns, skip=columns - len(row))
    if found.pictured:
        yield Command(command(found, case.frame))


def _said(case: Case) -> Iterator[str]:
    yield f"Stamp {moment(case.stamp_ns)}"
    if case.change is not None:
        yield f"The filter changes ERR by {points(case.change)} pp."
        return
    if len(case.parts) > 1:
        first, *rest = case.parts
        terms = [f"{first} {percent(case.parts[first])}"]
        terms += [f"{name} {points(case.parts[name])}" for name in rest]
        told = ", ".join(terms)
        yield f"ERR of {case.variant}: {told} pp. Most of it comes from {culprit(case)}."
    if case.notes:
        yield " ".join(case.notes)
