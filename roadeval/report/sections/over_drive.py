"""Rates over the drive: the paper's table, and its figures 2, 3a and 3b."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from roadeval.data.words import DASH, percent
from roadeval.evaluation import score
from roadeval.evaluation.metrics import FULL
from roadeval.report.blocks import (
    Block,
    Cell,
    Figure,
    Heading,
    ImageGrid,
    KeepTogether,
    Table,
    Text,
)
from roadeval.report.charts.rates import figures_over_drive
from roadeval.report.findings import Findings
from roadeval.report.images import variants_of
from roadeval.report.sections.common import SIDE_BY_SIDE, example_pictures
from roadeval.results.sentences import CLAIMED

PAPER_WINDOW: Final = 10
"""Frames in a row of the paper's figures (section 5)."""
RATES: Final = 4
"""Rates that share a table where the variants stand side by side."""
NO_NUMBERS: Final = (
    "The paper's text gives no number for its figures 3a and 3b, and their curves are lost, so "
    "nothing can be held against it number by number. Its claims can be checked."
)


def section(findings: Findings) -> Iterator[Block]:
    """Yield the rates over the drive as the paper shows them."""
    yield Heading("Over the drive: the paper's tables and figures")
    if len(findings.windows):
        yield from _tables(findings)
    if findings.examples:
        pictures = list(example_pictures(findings.examples))
        yield ImageGrid(pictures, len(variants_of(findings.examples)) + 2)
        yield Text("The paper's figure 2: input and output images, and the truth.", "note")
    for figure in figures_over_drive():
        if charts := figure.charts(findings.windows):
            yield Figure(charts, figure.caption)
    yield from _claims(findings)


def _claims(findings: Findings) -> Iterator[Block]:
    """Tabulate in how many windows the paper's claims are borne out."""
    found = findings.facts.claims
    short = any(each["short"] for each in found.values())
    rows = [
        [
            words,
            f"{each['held']} of {each['windows']}",
            *([f"{each['short_held']} of {each['short']}"] if short else []),
        ]
        for name, words in CLAIMED.items()
        if (each := found.get(name))
    ]
    if not rows:
        return
    table = Table(
        ["claim", "borne out by", *(["shorter, at the end"] if short else [])],
        rows,
        caption=f"Windows of {findings.facts.evaluation.window} frames that bear it out, of those "
        "in which both rates are defined. Equal rates do not.",
    )
    yield KeepTogether([Heading("What the paper claims", 2), Text(NO_NUMBERS), table])


def _tables(findings: Findings) -> Iterator[Block]:
    """Tabulate the windows; several tables where the variants do not fit side by side."""
    together = RATES if len(findings.finals) <= SIDE_BY_SIDE else 1
    names = [*FULL]
    for place in range(0, len(names), together):
        yield _table(findings, names[place : place + together])
    size = findings.window_size
    long = "" if size == PAPER_WINDOW else f" The paper's rows are of {PAPER_WINDOW}."
    rest = score.each_window(findings.windows)["frames"][-1]
    short = f" The last row holds {rest}." if rest < size else ""
    yield Text(
        f"Rows of {size} evaluated frames: the mean of the frames' rates in percent.{long}{short} "
        "The last line is the mean over all evaluated frames.",
        "note",
    )


def _table(findings: Findings, rates: Sequence[str]) -> Table:
    windows, names = findings.windows, [*findings.finals]
    masks = zip(*(windows[each] for each in ("variant", "stage", "window")), strict=True)
    places = {mask: place for place, mask in enumerate(masks)}

    def cell(name: str, window: int, rate: str) -> str:
        place = places.get((name, findings.finals[name], window))
        return percent(None if place is None else float(windows[rate][place]))

    each = score.each_window(windows)
    spans = (each[name].tolist() for name in ("window", "first_frame", "last_frame"))
    rows: list[list[Cell | str]] = [
        [
            _span(first, last),
            *(cell(name, number, rate) for rate in rates for name in names),
        ]
        for number, first, last in zip(*spans, strict=True)
    ]
    whole = [percent(findings.total(name).get(rate)) for rate in rates for name in names]
    rows.append([Cell(text, bold=True) for text in ("all", *whole)])
    return Table(
        ["frames", *(name for _ in rates for name in names)],
        rows,
        breaks=[len(rows) - 1],
        groups=[("", 1), *((f"{rate}, %", len(names)) for rate in rates)],
        small=True,
    )


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}{DASH}{last}"
