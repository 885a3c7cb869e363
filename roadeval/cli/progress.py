"""Progress on stderr: a bar at a terminal, elsewhere a plain line from time to time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

from roadeval.cli import console, messages
from roadeval.jobs.progress import Progress

LINE_PERIOD_S: Final = 10.0
"""Seconds between two plain lines, so that the log file of a long run stays short."""


@contextmanager
def show(quiet: bool = False) -> Iterator[Callable[[Progress], None]]:
    """Yield the function that a job calls with its progress; the display lasts for the block."""
    if quiet:
        yield lambda _progress: None
        return
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Display

    stderr = console.diagnostics()
    columns = (BarColumn(bar_width=None), TextColumn("{task.description}"))
    lines = not stderr.is_terminal
    with Display(*columns, console=stderr, transient=True, expand=True, disable=lines) as display:
        yield Watch(display, lambda line: stderr.print(line, soft_wrap=True), lines=lines)


class Watch:
    """Progress on a display of Rich, which also measures the pace.

    With ``lines``, plain lines are written instead of a bar: when a stage begins or ends, and every
    `LINE_PERIOD_S` seconds.
    """

    def __init__(self, display: Any, write: Callable[[str], None], *, lines: bool) -> None:
        self._display = display
        self._task = display.add_task("opening", total=None)
        self._write = write
        self._lines = lines
        self._stage = ""
        self._written = 0.0

    def __call__(self, progress: Progress) -> None:
        """Show how far a job is."""
        begins = progress.stage != self._stage
        if progress.note:
            messages.note(progress.note)
        if begins:
            self._stage = progress.stage
            self._display.reset(self._task, completed=progress.done)
        # Before the first item is done the pace is not known; the bar shows that work goes on.
        total = progress.total if progress.done else None
        self._display.update(self._task, completed=progress.done, total=total)
        text = self._describe(progress)
        self._display.update(self._task, description=text)
        due = time.monotonic() - self._written >= LINE_PERIOD_S
        if self._lines and (begins or due or progress.done == progress.total):
            self._written = time.monotonic()
            self._write(text)

    def _describe(self, progress: Progress) -> str:
        """Return a line: ``replaying: 4 of 10 frames, 23.4 frames/s, 12 s left``."""
        if not progress.done:
            return progress.stage
        total = f" of {progress.total}" if progress.total is not None else ""
        parts = [f"{progress.done}{total} {progress.unit}"]
        (task,) = self._display.tasks
        if task.speed:
            parts.append(f"{task.speed:.1f} {progress.unit}/s")
            if task.time_remaining is not None:
                parts.append(f"{duration(task.time_remaining)} left")
        parts += [progress.detail] if progress.detail else []
        return f"{progress.stage}: {', '.join(parts)}"


def duration(seconds: float) -> str:
    """Return a duration in words.

    >>> duration(42.3), duration(600), duration(9000)
    ('42 s', '10 min', '2 h 30 min')
    """
    if seconds < 100:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"
