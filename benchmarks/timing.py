"""Times with their spread: a single time says nothing on a machine that does other work too."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Spread:
    """Median, least and greatest of some numbers, and how many they are."""

    median: float
    least: float
    greatest: float
    runs: int

    @classmethod
    def of(cls, numbers: Sequence[float]) -> Spread:
        """Sum up at least one number."""
        return cls(statistics.median(numbers), min(numbers), max(numbers), len(numbers))

    def __str__(self) -> str:
        return f"{self.median:.4g} ({self.least:.4g} to {self.greatest:.4g})"


def ratios(these: Sequence[float], those: Sequence[float]) -> Spread:
    """Divide measurements of the same round, round by round."""
    return Spread.of([a / b for a, b in zip(these, those, strict=True)])


@dataclass(frozen=True)
class Cost:
    """Seconds by the clock, and of all processor cores together."""

    wall: float
    cpu: float


class Meter:
    """Measures the process from the moment that it is made."""

    def __init__(self) -> None:
        self._start = perf_counter(), process_time()

    def read(self) -> Cost:
        """Give the cost so far."""
        return Cost(perf_counter() - self._start[0], process_time() - self._start[1])


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """Do it, and give the seconds it took."""
    start = perf_counter()
    result = work()
    return result, perf_counter() - start


def table(title: str, rows: Sequence[dict[str, Any]]) -> str:
    """Lay out rows of equal keys."""
    names = list(rows[0])
    lines = [names, *([str(row[name]) for name in names] for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(names))]
    body = ("  ".join(cell.ljust(w) for cell, w in zip(x, widths, strict=True)) for x in lines)
    return "\n".join([title, *(f"  {line.rstrip()}" for line in body), ""])
