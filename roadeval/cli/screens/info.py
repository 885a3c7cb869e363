"""The description of a log as a screen of text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from roadeval.cli import console
from roadeval.cli.options import with_flags
from roadeval.data.words import timestamp
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

NS = 1_000_000_000
NAME = 28
"""Letters of a topic's name that stay in a line, so that the numbers beside it have room."""


def show(found: Mapping[str, Any], out: Console) -> None:
    """Print what `roadeval.logs.describe` found, as plain data."""
    out.print(f"{found['path']}: {_extent(found)}", soft_wrap=True)
    out.print()
    out.print(_topics(found["topics"], out.width))
    for topic in found["topics"]:
        if topic["problem"]:
            out.print(f"{topic['name']} cannot be read: {topic['problem']}", soft_wrap=True)
        for gap in topic["gaps"]:
            out.print(f"{topic['name']}: {_gap(gap, found['start_ns'])}", soft_wrap=True)
    for oddity in found["oddities"]:
        out.print(oddity, soft_wrap=True)
    out.print()
    if found["problem"]:
        out.print(f"replay would stop: {with_flags(found['problem'])}", soft_wrap=True)
    else:
        out.print("replay would pick")
        for pick in found["picks"]:
            out.print(
                console.wrapped(with_flags(pick), out.width, indent=2, hang=2), soft_wrap=True
            )


def _extent(found: Mapping[str, Any]) -> str:
    start, end = found["start_ns"], found["end_ns"]
    known = "" if found["verified"] else "; not read whole, --verify looks for all damage"
    size = f"{found['bytes'] / 1e6:.1f} MB"
    return f"{(end - start) / NS:.1f} s from {timestamp(start)}, {size}{known}"


def _gap(gap: tuple[int, int], start: int) -> str:
    before, after = gap
    return f"gap of {(after - before) / NS:.2f} s, {(before - start) / NS:.2f} s after the start"


def _topics(topics: list[dict[str, Any]], room: int) -> RenderableType:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    longest = max((len(visible(topic["name"])) for topic in topics), default=0)
    table.add_column("topic", overflow="fold", min_width=min(longest, NAME))
    # The longest word would be kept whole, and push the numbers out.
    table.add_column("carries", overflow="fold", max_width=room // 5)
    for name in ("size", "messages", "rate"):
        table.add_column(name, justify="right", no_wrap=True)
    for topic in topics:
        table.add_row(
            topic["name"],
            _carries(topic),
            "x".join(str(side) for side in topic["size"] or ()),
            str(topic["count"]),
            _rate(topic["rate_hz"]),
        )
    return table


def _rate(rate: float | None) -> str:
    if not rate:
        return ""
    return f"{rate:.4g} Hz" if rate >= 0.01 else "< 0.01 Hz"


def _carries(topic: Mapping[str, Any]) -> str:
    what = topic["format"] or topic["schema"] or "no schema"
    return f"{what} ({topic['encoding']})"
