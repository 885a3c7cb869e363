"""Progress of a fleet on stderr: a bar at a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from roadeval.cli import console
from roadeval.cli.progress import LINE_PERIOD_S

if TYPE_CHECKING:
    from roadeval.jobs.fleet import FleetProgress, OnFleetProgress


@contextmanager
def watched(quiet: bool = False) -> Iterator[OnFleetProgress]:
    """Yield the function that a fleet calls with its progress; the display ends with the block."""
    if quiet:
        yield lambda _progress: None
        return
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Display

    stderr = console.diagnostics()
    columns = (BarColumn(bar_width=None), TextColumn("{task.description}"))
    lines = not stderr.is_terminal
    with Display(*columns, console=stderr, transient=True, expand=True, disable=lines) as display:
        yield Watch(display, stderr, lines=lines)


class Watch:
    """Shows each progress on a Rich display, or writes it as plain lines."""

    def __init__(self, display: Any, stderr: Any, *, lines: bool) -> None:
        self._display = display
        self._task = display.add_task("", total=None)
        self._stderr = stderr
        self._lines = lines
        self._stage = ""
        self._written = 0.0
        self._dashboard: str | None = None

    def __call__(self, progress: FleetProgress) -> None:
        """Show how far a fleet is."""
        if progress.dashboard is not None and progress.dashboard != self._dashboard:
            self._dashboard = progress.dashboard
            self._stderr.print(f"workers   {progress.dashboard}", soft_wrap=True)
        text = line(progress)
        total = progress.total if progress.stage == "replaying" else None
        self._display.update(self._task, completed=progress.done, total=total, description=text)
        begins = progress.stage != self._stage
        ends = progress.done == progress.total
        if self._lines and (begins or ends or time.monotonic() - self._written >= LINE_PERIOD_S):
            self._stage, self._written = progress.stage, time.monotonic()
            self._stderr.print(text, soft_wrap=True)
        self._stage = progress.stage


def line(progress: FleetProgress) -> str:
    """Write a fleet's progress as a line."""
    if progress.stage != "replaying":
        return progress.stage
    parts = [f"{progress.done} of {progress.total} drives"]
    if progress.failed:
        parts.append(f"{progress.failed} failed")
    if progress.running:
        parts.append(f"{progress.running} running")
    if progress.frames:
        parts.append(f"{progress.frames / progress.seconds:.1f} frames/s")
    own = progress.done - progress.kept
    if own and progress.done < progress.total:
        left = progress.seconds / own * (progress.total - progress.done)
        parts.append(f"{duration(left)} left")
    return ", ".join(parts)


def duration(seconds: float) -> str:
    """Write a duration for a person.

    >>> duration(42.3), duration(600), duration(9000)
    ('42 s', '10 min', '2 h 30 min')
    """
    if seconds < 100:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"
