"""Progress on stderr: a bar at a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

from roadeval.cli import console

if TYPE_CHECKING:
    from roadeval.jobs.progress import OnProgress, Progress

LINE_PERIOD_S: Final = 10.0
"""At most one plain line in this time, so that a log file of a long run stays short."""


@contextmanager
def watched(quiet: bool = False) -> Iterator[OnProgress]:
    """Yield the function that a job calls with its progress; the display ends with the block."""
    if quiet:
        yield lambda _progress: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
    from rich.progress import Progress as Display

    stderr = console.diagnostics()
    columns = (
        TextColumn("{task.description:<9}"),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("{task.fields[pace]}"),
    )
    lines = not stderr.is_terminal
    with Display(*columns, console=stderr, transient=True, expand=True, disable=lines) as display:
        write = (lambda line: stderr.print(line, soft_wrap=True)) if lines else None
        yield Watch(display, write)


class Watch:
    """Shows each progress on a Rich display, or writes it as plain lines.

    Parameters
    ----------
    display
        A `rich.progress.Progress`; it measures the pace even where it shows nothing.
    write
        Writes a line: one as a stage begins, then one in `LINE_PERIOD_S`. None: no lines.
    """

    def __init__(self, display: Any, write: Callable[[str], None] | None) -> None:
        self._display = display
        self._task = display.add_task("opening", total=None, pace="")
        self._write = write
        self._stage = ""
        self._written = 0.0

    def __call__(self, progress: Progress) -> None:
        """Show how far a job is."""
        begins = progress.stage != self._stage
        if begins:
            self._stage = progress.stage
            self._display.reset(self._task, description=progress.stage, completed=progress.done)
        # Before the first frame nothing is known; the bar shows that something moves.
        total = progress.total if progress.done else None
        self._display.update(self._task, completed=progress.done, total=total)
        pace = self._pace()
        self._display.update(self._task, pace="  ".join(pace))
        if self._write and (begins or time.monotonic() - self._written >= LINE_PERIOD_S):
            self._written = time.monotonic()
            self._write(line(progress, pace))

    def _pace(self) -> tuple[str, ...]:
        """Return rate and time left for a person, as ``("23.4 frames/s", "12 s left")``."""
        (task,) = self._display.tasks
        if not task.speed:
            return ()
        left = task.time_remaining
        return f"{task.speed:.1f} frames/s", *([] if left is None else [f"{left:.0f} s left"])


def line(progress: Progress, pace: tuple[str, ...] = ()) -> str:
    """Write a job's progress as a line."""
    if not progress.done:
        return progress.stage
    of = f" of {progress.total}" if progress.total is not None else ""
    return f"{progress.stage}: {', '.join((f'{progress.done}{of} frames', *pace))}"
