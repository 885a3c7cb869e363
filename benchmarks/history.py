"""What is named in histories by chance, and what is found: ``python -m benchmarks.history``.

Histories are made up, so that their truth is known, and passed to the function that `roadeval` uses.
``--write`` puts the tables into docs/explanation/history.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.evaluation.stats.steps import NIGHTS, trace

Values = npt.NDArray[np.float64]
Draw = Callable[[np.random.Generator, tuple[int, ...]], Values]
"""Draws noise whose middle two thirds lie within 1, about."""

POINT: Final = 0.01
PAGE: Final = Path(__file__).parents[1] / "docs" / "explanation" / "history.md"
DRIVES: Final = (5, 20, 200)
RUN_NOISES: Final = (0.0, 0.05, 0.2)
"""Noise that all drives of a run share, in points."""
LENGTHS: Final = (10, 30, 100, 300)
SIZES: Final = (0.3, 1.0, 3.0)


# --- Made-up histories ----------------------------------------------------------------------------


def contaminated(rng: np.random.Generator, shape: tuple[int, ...]) -> Values:
    """Return normal noise that is five times as strong in one of ten draws."""
    return rng.standard_normal(shape) * np.where(rng.random(shape) < 0.1, 5.0, 1.0)


NOISES: Final[dict[str, Draw]] = {
    "normal": lambda rng, shape: rng.standard_normal(shape),
    "Laplace": lambda rng, shape: rng.laplace(size=shape),
    "t3": lambda rng, shape: rng.standard_t(3, shape),
    "contaminated": contaminated,
}


def of_all(rng: np.random.Generator, runs: int, drives: int) -> Values:
    """Every run has every drive."""
    return np.ones((runs, drives))


def missing(rng: np.random.Generator, runs: int, drives: int) -> Values:
    """Each drive misses one run of twenty, by chance."""
    return np.where(rng.random((runs, drives)) < 0.05, np.nan, 1.0)


def exchanged(rng: np.random.Generator, runs: int, drives: int) -> Values:
    """Each drive is there from some run on, up to another; some are there all the time."""
    first = np.where(rng.random(drives) < 0.5, 0, rng.integers(0, runs, drives))
    last = np.where(rng.random(drives) < 0.5, runs, rng.integers(0, runs, drives))
    last[0], first[0] = runs, 0
    at = np.arange(runs)[:, None]
    return np.where((first <= at) & (at < last), missing(rng, runs, drives), np.nan)


def growing(rng: np.random.Generator, runs: int, drives: int) -> Values:
    """The drives grow from a fifth to all."""
    there = np.arange(drives) < np.linspace(max(drives / 5, 1), drives, runs)[:, None]
    return np.where(there, missing(rng, runs, drives), np.nan)


FLEETS: Final = {
    "all drives": of_all,
    "missing": missing,
    "exchanged": exchanged,
    "growing": growing,
}


def history(
    rng: np.random.Generator,
    runs: int,
    drives: int,
    draw: Draw = NOISES["t3"],
    fleet: Callable[[np.random.Generator, int, int], Values] = missing,
    run_noise: float = 0.05,
    spread: tuple[float, float] = (0.5, 2.0),
) -> Values:
    """Make up the rates of drives in runs, ``(T, D)``, that change by noise alone.

    ``spread`` are the least and the greatest noise of a drive, in points.
    """
    sizes = np.exp(rng.uniform(*np.log(spread), drives))
    levels = 5 * np.exp(0.5 * rng.standard_normal(drives))
    rates = levels + sizes * draw(rng, (runs, drives)) + run_noise * draw(rng, (runs, 1))
    return POINT * rates * fleet(rng, runs, drives)


# --- The tables -----------------------------------------------------------------------------------


def false_alarms(years: int) -> Iterator[str]:
    """Yield the lines of a table: in how many of 100 years anything is named by chance.

    Runs share 0, 0.05 or 0.2 points of noise, and there are 5, 20 or 200 drives, in turns.
    """
    yield f"| drives | noise of a drive, points | {' | '.join(NOISES)} |"
    yield f"|---|---|{'--:|' * len(NOISES)}"
    for name, fleet in FLEETS.items():
        for spread in ((0.5, 2.0), (0.1, 10.0)):
            cells = []
            for kind, draw in enumerate(NOISES.values()):
                false = 0
                for year in range(years):
                    rng, drives = np.random.default_rng([1, kind, year]), DRIVES[year % 3]
                    run_noise = RUN_NOISES[year // 3 % 3]
                    rates = history(rng, 365, drives, draw, fleet, run_noise, spread)
                    false += bool(trace(rates, np.ones(drives)).steps)
                cells.append(f"{100 * false / years:.1f}")
            yield f"| {name} | {spread[0]:g} to {spread[1]:g} | {' | '.join(cells)} |"


def family_alarms(years: int, family: int = 20) -> str:
    """Say in how many years anything is named in any of so many series, regions for example."""
    false = 0
    for year in range(years):
        rng, drives = np.random.default_rng([2, year]), DRIVES[year % 2]
        series = (history(rng, 365, drives) for _ in range(family))
        false += any(trace(rates, np.ones(drives), family).steps for rates in series)
    return f"{family} series together, t3: {false} of {years} years."


def plant(kind: str, runs: int, size: float) -> tuple[Values, int]:
    """Return what is added to each run's rates, ``(T, 1)``, and the run from which on it is."""
    first = runs // 2
    at = np.arange(runs) - first
    shape = {"step": at >= 0, "outlier": at == 0, "drift": np.clip((at + 1) / 30, 0, 1)}[kind]
    return POINT * size * shape[:, None], first


def planted(kind: str, size: float, histories: int) -> Iterator[str]:
    """Yield a line for each number of drives: what is found in histories of each length."""
    for drives in DRIVES:
        cells = []
        for runs in LENGTHS:
            late, off = [], []
            for number in range(histories):
                rng = np.random.default_rng([3, drives, runs, number])
                rates = history(rng, runs, drives, run_noise=RUN_NOISES[number % 3])
                added, first = plant(kind, runs, size)
                steps = [
                    step
                    for step in trace(rates + added, np.ones(drives)).steps
                    if step.change > 0 and step.found >= first
                ]
                if steps:
                    late.append(steps[0].found - first + 1)
                    off.append(abs(steps[0].run - first))
            share = len(late) / histories
            if late:
                runs_to = f"{np.median(late):.0f} ({np.quantile(late, 0.9):.0f})"
                right = f"{100 * np.mean(np.array(off) == 0):.0f}/{100 * np.mean(np.array(off) <= 2):.0f}"
                cells.append(f"{100 * share:.0f} %, {runs_to}, {right}")
            else:
                cells.append("0 %")
        yield f"| {kind} of {size:g} | {drives} | {' | '.join(cells)} |"
