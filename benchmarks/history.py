"""What is named in histories by chance, and what is found: ``python -m benchmarks.history``.

Histories are made up, so that their truth is known, and passed to the function of `roadeval`.
``--write`` puts the tables into docs/explanation/history.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from benchmarks.intervals import show
from roadeval.evaluation.stats.steps import trace

Values = npt.NDArray[np.float64]
Random = np.random.Generator
Draw = Callable[[Random, tuple[int, ...]], Values]
Fleet = Callable[[Random, int, int], Values]
"""Returns 1 where a run has a drive, else NaN, ``(T, D)``."""

POINT: Final = 0.01
PAGE: Final = Path(__file__).parents[1] / "docs" / "explanation" / "history.md"
DRIVES: Final = (5, 20, 200)
RUN_NOISES: Final = (0.0, 0.05, 0.2)
"""Noise that all drives of a run share, in points."""
LENGTHS: Final = (10, 30, 100, 300)
PLANTED: Final = (("step", 0.3), ("step", 1.0), ("step", 3.0), ("drift", 1.0), ("outlier", 10.0))
SPREADS: Final = ((0.5, 2.0), (0.1, 10.0))
"""The least and the greatest noise of a drive, in points."""


# --- Made-up histories ----------------------------------------------------------------------------


def contaminated(rng: Random, shape: tuple[int, ...]) -> Values:
    """Return normal noise that is five times as strong in one of ten draws."""
    return rng.standard_normal(shape) * np.where(rng.random(shape) < 0.1, 5.0, 1.0)


NOISES: Final[dict[str, Draw]] = {
    "normal": lambda rng, shape: rng.standard_normal(shape),
    "Laplace": lambda rng, shape: rng.laplace(size=shape),
    "t3": lambda rng, shape: rng.standard_t(3, shape),
    "contaminated": contaminated,
}


def complete(_: Random, runs: int, drives: int) -> Values:
    """Return runs that have every drive."""
    return np.ones((runs, drives))


def missing(rng: Random, runs: int, drives: int) -> Values:
    """Return runs of which each lacks one drive of twenty, by chance."""
    return np.where(rng.random((runs, drives)) < 0.05, np.nan, 1.0)


def exchanged(rng: Random, runs: int, drives: int) -> Values:
    """Return runs between which drives are added, and others removed, for good."""
    first = np.where(rng.random(drives) < 0.5, 0, rng.integers(0, runs, drives))
    last = np.where(rng.random(drives) < 0.5, runs, rng.integers(0, runs, drives))
    last[0], first[0] = runs, 0
    at = np.arange(runs)[:, None]
    return np.where((first <= at) & (at < last), missing(rng, runs, drives), np.nan)


def growing(rng: Random, runs: int, drives: int) -> Values:
    """Return runs whose drives grow from a fifth to all."""
    there = np.arange(drives) < np.linspace(drives / 5, drives, runs)[:, None]
    return np.where(there, missing(rng, runs, drives), np.nan)


FLEETS: Final[dict[str, Fleet]] = {
    "all drives in every run": complete,
    "5 % missing": missing,
    "added and removed for good": exchanged,
    "growing": growing,
}


def history(
    rng: Random,
    runs: int,
    drives: int,
    draw: Draw = NOISES["t3"],
    fleet: Fleet = missing,
    *,
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

    There are 5, 20 or 200 drives, and runs share 0, 0.05 or 0.2 points of noise, in turns.
    """
    yield f"| drives | {' | '.join(NOISES)} |"
    yield f"|---|{'--:|' * len(NOISES)}"
    for name, fleet in FLEETS.items():
        cells = []
        for kind, draw in enumerate(NOISES.values()):
            false = [0, 0]
            for year in range(2 * years):
                rng, drives = np.random.default_rng([1, kind, year]), DRIVES[year % 3]
                shared, spread = RUN_NOISES[year // 3 % 3], SPREADS[year % 2]
                rates = history(rng, 365, drives, draw, fleet, run_noise=shared, spread=spread)
                false[year % 2] += bool(trace(rates, np.ones(drives)).steps)
            cells.append(" / ".join(f"{100 * count / years:.1f}" for count in false))
        yield f"| {name} | {' | '.join(cells)} |"


def family_alarms(years: int, family: int = 20) -> str:
    """Say in how many years anything is named in any of so many series, regions for example."""
    false = 0
    for year in range(years):
        rng, drives = np.random.default_rng([2, year]), DRIVES[year % 2]
        series = [history(rng, 365, drives) for _ in range(family)]
        false += any(trace(rates, np.ones(drives), family).steps for rates in series)
    return f"In {false} of {years} years with {family} series each, anything is named by chance."


def plant(kind: str, runs: int, size: float) -> tuple[Values, int]:
    """Return what is added to each run's rates, ``(T, 1)``, and the first run that has it."""
    first = runs // 2
    at = np.arange(runs) - first
    shape = {"step": at >= 0, "outlier": at == 0, "drift": np.clip((at + 1) / 30, 0, 1)}[kind]
    return POINT * size * shape[:, None], first


def found(kind: str, size: float, drives: int, runs: int, histories: int) -> str:
    """Return the cell of histories in the middle of which something is planted."""
    late, off = [], []
    for number in range(histories):
        rng = np.random.default_rng([3, drives, runs, number])
        rates = history(rng, runs, drives, run_noise=RUN_NOISES[number % 3])
        added, first = plant(kind, runs, size)
        steps = trace(rates + added, np.ones(drives)).steps
        named = [step for step in steps if step.change > 0 and step.alarm >= first]
        if named:
            late.append(named[0].alarm - first + 1)
            off.append(abs(named[0].run - first))
    if not late:
        return "0"
    exact, near = (100 * np.mean(np.array(off) <= most) for most in (0, 2))
    runs_to = np.quantile(late, (0.5, 0.9))
    times = f"{runs_to[0]:.0f} ({runs_to[1]:.0f})"
    return f"{100 * len(late) / histories:.0f}: {times}, {exact:.0f}/{near:.0f}"


def powers(histories: int) -> Iterator[str]:
    """Yield the lines of a table: what is found in histories of each length."""
    yield f"| planted, points | drives | {' | '.join(f'{runs} runs' for runs in LENGTHS)} |"
    yield f"|---|--:|{'---|' * len(LENGTHS)}"
    for kind, size in PLANTED:
        for drives in DRIVES:
            cells = [found(kind, size, drives, runs, histories) for runs in LENGTHS]
            yield f"| {kind} of {size:g} | {drives} | {' | '.join(cells)} |"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--years", type=int, default=100, help="years a number")
    parser.add_argument("--histories", type=int, default=60, help="planted histories a cell")
    parser.add_argument("--write", action="store_true", help="into the page, too")
    options = parser.parse_args()
    show("found", powers(options.histories), write=options.write, page=PAGE)
    family = [family_alarms(options.years // 2)]
    show("family", family, write=options.write, page=PAGE)
    show("false alarms", false_alarms(options.years), write=options.write, page=PAGE)


if __name__ == "__main__":
    main()
