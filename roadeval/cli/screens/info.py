"""The description of a log as a screen of text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from roadeval.cli import console
from roadeval.cli.options import with_flags
from roadeval.cli.screens import tables
from roadeval.data.words import timestamp
from roadeval.report.blocks import Table

if TYPE_CHECKING:
    from rich.console import Console

NS = 1_000_000_000


def show(found: Mapping[str, Any], out: Console) -> None:
    """Print what `roadeval.logs.log.describe` found, as plain data."""
    start, end = found["start_ns"], found["end_ns"]
    size = f"{found['bytes'] / 1e6:.1f} MB"
    known = "" if found["verified"] else "; not read whole, --verify looks for all damage"
    length = f"{(end - start) / NS:.1f} s from {timestamp(start)}"
    out.print(f"{found['path']}: {length}, {size}{known}", soft_wrap=True)
    out.print()
    tables.show_table(_topics(found["topics"]), out)
    for topic in found["topics"]:
        if topic["problem"]:
            out.print(f"{topic['name']} cannot be read: {topic['problem']}", soft_wrap=True)
        for before, after in topic["gaps"]:
            gap = f"gap of {(after - before) / NS:.2f} s, {(before - start) / NS:.2f} s after"
            out.print(f"{topic['name']}: {gap} the start", soft_wrap=True)
    out.print()
    if found["problem"]:
        out.print(f"replay would stop: {with_flags(found['problem'])}", soft_wrap=True)
    else:
        for misfit in found["misfits"]:
            out.print(console.wrapped(with_flags(misfit), out.width, 0), soft_wrap=True)
        out.print("replay would pick")
        for pick in found["picks"]:
            out.print(
                console.wrapped(with_flags(pick), out.width, indent=2, hang=2), soft_wrap=True
            )


def _topics(topics: Sequence[Mapping[str, Any]]) -> Table:
    return Table(
        ["topic", "carries", "size", "messages", "rate"],
        [
            [
                topic["name"],
                f"{topic['format'] or topic['schema'] or 'no schema'} ({topic['encoding']})",
                "x".join(str(side) for side in topic["size"] or ()),
                str(topic["count"]),
                _rate(topic["rate_hz"]),
            ]
            for topic in topics
        ],
        text_columns=(0, 1),
    )


def _rate(rate: float | None) -> str:
    if not rate:
        return ""
    return f"{rate:.4g} Hz" if rate >= 0.01 else "< 0.01 Hz"
