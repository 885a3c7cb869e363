"""The description of a log on one screen."""

from __future__ import annotations

from typing import TYPE_CHECKING

from roadeval.cli import console
from roadeval.cli.options import with_flags
from roadeval.cli.screens import tables
from roadeval.data.words import timestamp
from roadeval.report.blocks import Table

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.logs.log import LogDescription

NS = 1_000_000_000


def show(log: LogDescription, out: Console) -> None:
    """Print what a log holds, and what replay would pick from it."""
    size = f"{log.bytes / 1e6:.1f} MB"
    is_partial = not log.verified and not log.by_summary
    unverified = "; only a part was read: --verify looks for all damage" if is_partial else ""
    length = f"{(log.end_ns - log.start_ns) / NS:.1f} s from {timestamp(log.start_ns)}"
    console.say(f"{log.path}: {length}, {size}{unverified}", out)
    if read := log.traffic:
        parts = ": the log's summary and first messages; --verify checks every chunk"
        console.say(f"read {read}{parts if log.by_summary else ''}", out)
    out.print()
    columns, rows = ["topic", "carries", "size", "messages", "rate"], []
    for topic in log.topics:
        carries = f"{topic.format or topic.schema or 'no schema'} ({topic.encoding})"
        rate = f"{topic.rate_hz:.4g} Hz" if topic.rate_hz else ""
        rate = "< 0.01 Hz" if topic.rate_hz and topic.rate_hz < 0.01 else rate
        pixels = "x".join(map(str, topic.size or ()))
        rows.append([topic.name, carries, pixels, str(topic.count), rate])
    tables.show_table(Table(columns, rows, text_columns=(0, 1)), out)
    for topic in log.topics:
        if topic.problem:
            console.say(f"{topic.name} cannot be read: {with_flags(topic.problem)}", out)
        for before, after in topic.gaps:
            gap = f"gap of {(after - before) / NS:.2f} s"
            start = f"{(before - log.start_ns) / NS:.2f} s after the start"
            console.say(f"{topic.name}: {gap}, {start}", out)
    out.print()
    if log.problem:
        console.say(f"replay would stop: {with_flags(log.problem)}", out)
        return
    for misfit in log.misfits:
        out.print(console.wrap(with_flags(misfit), out.width, 0), soft_wrap=True)
    out.print("replay would pick")
    for pick in log.picks:
        out.print(console.wrap(with_flags(pick), out.width, indent=2, hang=2), soft_wrap=True)
