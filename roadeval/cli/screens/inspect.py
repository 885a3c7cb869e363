"""The worst frames on one screen of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from roadeval.cli.screens.tables import show_table
from roadeval.data.words import percent, short_names
from roadeval.evaluation.metrics import TESTED
from roadeval.report.blocks import Table
from roadeval.results.fleet import APART_NS, OF_A_DRIVE
from roadeval.results.verdict import describe_errors

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.jobs.results.inspect import WorstFrame


def show(name: str, frames: Sequence[WorstFrame], out: Console, *, of_fleet: bool) -> None:
    """Print the worst frames with their rates.

    A drive's frames have a column with their errors and notes; a fleet's frames have a column that
    says whether the recording of their drive was kept.
    """
    first, is_scored = frames[0], frames[0].by == TESTED
    what, rule = "worst frames", "the worst of each scene"
    if not is_scored:
        what = "without truth, frames to look at"
        rule = "one per scene; ranked by uncertainty, not by error"
    elif of_fleet:
        rule = f"at most {OF_A_DRIVE} per drive, {APART_NS / 1e9:g} seconds apart"
    out.print(f"{name}: {what} of {first.variant} by {first.by} of {first.stage} ({rule})")
    out.print()
    columns = {"": [str(frame.rank) for frame in frames]}
    if of_fleet:
        names = {frame.drive: frame.drive.rpartition("-")[0] for frame in frames}
        clear = len({*names.values()}) == len(names)
        columns["drive"] = [names[frame.drive] if clear else frame.drive for frame in frames]
    elif any(frame.camera for frame in frames):
        names = short_names([*dict.fromkeys(frame.camera for frame in frames)])
        columns["camera"] = [names[frame.camera] for frame in frames]
    columns["frame"] = [str(frame.frame) for frame in frames]
    for rate in first.rates:
        columns[f"{rate} %"] = [percent(frame.rates[rate]) for frame in frames]
    if of_fleet:
        columns["kept"] = ["yes" if frame.recording else "-" for frame in frames]
    elif is_scored:
        columns["why"] = []
        for frame in frames:
            notes = (note.removeprefix(f"{frame.variant} ") for note in frame.notes)
            clauses = [f"{describe_errors(frame.rates)}.", *notes]
            columns["why"].append(" ".join(text[:1].upper() + text[1:] for text in clauses))
    titles = [*columns]
    texts = {"drive", "camera", "why"} | ({""} if of_fleet else set())
    places = [place for place, title in enumerate(titles) if title in texts]
    breaks = range(1, len(frames)) if "why" in columns else ()
    rows = [[*row] for row in zip(*columns.values(), strict=True)]
    show_table(Table(titles, rows, text_columns=places, breaks=breaks), out)
    if of_fleet and not all(frame.recording for frame in frames):
        out.print()
        out.print("If a recording was not kept, --worst K says how to make it.")
