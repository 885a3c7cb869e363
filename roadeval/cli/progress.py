"""Progress on stderr: a bar at a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Protocol

from roadeval.cli import console

if TYPE_CHECKING:
    from rich.console import Console

LINE_PERIOD_S: Final = 10.0
"""At most one plain line in this time, so that a log file of a long run stays short."""


class Step(Protocol):
    """How far a job has come: ``done`` of ``total`` frames of ``stage``."""

    @property
    def done(self) -> int:
        """Frames done."""

    @property
    def total(self) -> int | None:
        """Frames to do, or None where that is not known."""

    @property
    def stage(self) -> str:
        """What is being done, as ``replaying``."""


Watch = Callable[[Step], None]


@contextmanager
def watched(quiet: bool = False) -> Iterator[Watch]:
    """Yield the function that a job calls with each `Step`; the display ends with the block."""
    stderr = console.diagnostics()
    if quiet:
        yield lambda _step: None
    elif stderr.is_terminal:
        with _bar(stderr) as watch:
            yield watch
    else:
        yield Lines(lambda line: stderr.print(line, soft_wrap=True))


@contextmanager
def _bar(stderr: Console) -> Iterator[Watch]:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (
        TextColumn("{task.description:<9}"),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("{task.fields[pace]}"),
    )
    with Progress(*columns, console=stderr, transient=True, expand=True) as bars:
        task = bars.add_task("opening", total=None, pace="")
        clock = StageClock()

        def watch(step: Step) -> None:
            clock.enters(step)
            bars.update(
                task,
                description=step.stage,
                completed=step.done,
                # Before the first frame nothing is known; the bar shows that something moves.
                total=step.total if step.done else None,
                pace="  ".join(clock.pace(step)),
            )

        yield watch


@dataclass
class StageClock:
    """When the stage in hand began, to tell its rate."""

    now: Callable[[], float] = time.monotonic
    stage: str = ""
    began: float = 0.0
    first: int = 0

    def enters(self, step: Step) -> bool:
        """Note the beginning of a stage; return whether this step is one."""
        if step.stage == self.stage:
            return False
        self.stage, self.began, self.first = step.stage, self.now(), step.done
        return True

    def frames_per_second(self, step: Step) -> float:
        """Return the mean rate since the stage began; 0 while nothing is known."""
        elapsed = self.now() - self.began
        return (step.done - self.first) / elapsed if elapsed > 0 else 0.0

    def pace(self, step: Step) -> tuple[str, ...]:
        """Return rate and time left for a person, as ``("23.4 frames/s", "12 s left")``."""
        rate = self.frames_per_second(step)
        if not rate:
            return ()
        if step.total is None:
            return (f"{rate:.1f} frames/s",)
        return f"{rate:.1f} frames/s", f"{(step.total - step.done) / rate:.0f} s left"


@dataclass
class Lines:
    """Progress as plain lines: one as a stage begins, then one now and then."""

    write: Callable[[str], None]
    clock: StageClock = field(default_factory=StageClock)
    written: float = 0.0

    def __call__(self, step: Step) -> None:
        """Take note of a step and write a line if it is time for one."""
        begins = self.clock.enters(step)
        if not begins and self.clock.now() - self.written < LINE_PERIOD_S:
            return
        self.written = self.clock.now()
        if not step.done:
            self.write(step.stage)
            return
        of = f" of {step.total}" if step.total is not None else ""
        figures = f"{step.done}{of} frames", *self.clock.pace(step)
        self.write(f"{step.stage}: {', '.join(figures)}")
