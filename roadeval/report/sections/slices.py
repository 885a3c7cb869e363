"""When a mask fails: confirmed conditions under which it errs more."""

from __future__ import annotations

from collections.abc import Iterator

from roadeval.data.words import number, percent
from roadeval.evaluation.stats.difference import LEAST_GROUPS
from roadeval.evaluation.stats.slices import LEAST_FRAMES
from roadeval.report.blocks import Block, Cell, Heading, Table, Text
from roadeval.report.captions import caption, note
from roadeval.report.findings import Findings
from roadeval.results.fleet import FleetFolder
from roadeval.results.schema import DAMAGED, SCORED
from roadeval.results.why import describe_place, describe_slice


def when_it_fails(findings: Findings | FleetFolder, level: int = 1) -> Iterator[Block]:
    """Yield the conditions under which the focus fails, or a sentence that none is confirmed.

    Yield nothing without a search. Frames are links only below a heading of ``level`` 1.
    """
    facts, of_fleet = findings.facts, isinstance(findings, FleetFolder)
    slices = facts.slices.get(facts.focus or "")
    if isinstance(findings, FleetFolder):
        drives = findings.drives
        scored = drives[drives["status"].isin([SCORED, DAMAGED])].astype(object)
        groups = scored["group"].fillna(scored["log_digest"]).nunique()
        names, unit, few = findings.names, "drives", groups < 2 * LEAST_GROUPS
    else:
        names, unit, few = {}, "drive", findings.facts.frames.evaluated < LEAST_FRAMES
    if facts.focus is None or (slices is None and not few):
        return
    yield Heading("When it fails", level)
    if not slices:
        least = f"{2 * LEAST_GROUPS} groups of drives" if of_fleet else f"{LEAST_FRAMES} frames"
        name = "no slices" if slices is not None else "too little for slices"
        yield Text(caption(name, variant=facts.focus, unit=unit, least=least))
        return
    rows: list[list[Cell | str]] = []
    for failure in slices:
        yield Text(describe_slice(failure))
        frames = [str(frame) for frame in failure.worst]
        if failure.drives:
            pairs = zip(failure.drives, frames, strict=True)
            frames = [f"{names.get(drive, drive)} {frame}" for drive, frame in pairs]
        linked = [] if failure.drives or level > 1 else failure.worst
        ratio = f"{failure.ratio:.1f} ({failure.low:.1f} to {failure.high:.1f})"
        rates = percent(failure.inside), percent(failure.outside)
        worst = Cell(", ".join(frames), frames=linked)
        rows.append([describe_place(failure), number(failure.frames), *rates, ratio, worst])
    columns = ["where", "frames", "ERR, %", "elsewhere, %", "ratio", "worst frames"]
    yield Table(columns, rows, text_columns=(0, 5), small=True)
    yield note("slices", variant=facts.focus, unit=unit)
