"""How often intervals hold the truth, on drives whose truth is known because they are made up.

Run as a program it prints the table that `roadeval.evaluation.uncertainty` quotes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import signal, stats

from roadeval.evaluation.autocorrelation import Series
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import mean_difference

Process = Callable[[np.random.Generator, int, float], Series]


@dataclass(frozen=True)
class Coverage:
    """Shares of the drives: withheld intervals, given ones that hold, and naive ones that do."""

    withheld: float
    given: float
    naive: float


def autoregression(rng: np.random.Generator, frames: int, rho: float) -> Series:
    """A drive of differences with mean 0, variance 1 and lag-1 correlation ``rho``."""
    noise = rng.standard_normal(frames + 500)
    series: Series = signal.lfilter([1], [1, -rho], noise)[500:] * np.sqrt(1 - rho**2)
    return series


def half_noise(rng: np.random.Generator, frames: int, rho: float) -> Series:
    """The same, half of its variance hidden under noise that differs from frame to frame."""
    return (autoregression(rng, frames, rho) + rng.standard_normal(frames)) / np.sqrt(2)


def bursts(rng: np.random.Generator, frames: int, rho: float) -> Series:
    """Nothing on most frames and, now and then, a stretch of differences; mean 0."""
    mean = stats.norm.pdf(0.5) - 0.5 * stats.norm.sf(0.5)
    return np.maximum(autoregression(rng, frames, rho) - 0.5, 0) - mean


def simulate(
    rho: float,
    frames: int,
    repetitions: int,
    settings: EvaluationSettings,
    process: Process = autoregression,
) -> Coverage:
    """Make up drives with a mean difference of 0 and count the intervals that hold it."""
    rng = np.random.default_rng(2013)
    given, naive = [], []
    for _ in range(repetitions):
        series = process(rng, frames, rho)
        found = mean_difference(series, settings)
        if found.low is not None:
            given.append(found.low <= 0 <= found.high)
        low, high = stats.t.interval(0.95, frames - 1, series.mean(), stats.sem(series))
        naive.append(low <= 0 <= high)
    shares = [float(np.mean(held)) if held else np.nan for held in (given, naive)]
    return Coverage(1 - len(given) / repetitions, *shares)


def main(repetitions: int = 1000) -> None:
    """Print the table."""
    for process, rho in (
        (autoregression, 0.5),
        (autoregression, 0.9),
        (half_noise, 0.95),
        (bursts, 0.9),
    ):
        for frames in (91, 500, 2000):
            found = simulate(rho, frames, repetitions, EvaluationSettings(), process)
            shares = (found.withheld, found.given, found.naive)
            cells = "".join(f"{100 * share:10.1f}" for share in shares)
            sys.stdout.write(f"{process.__name__:16}{rho:5}{frames:6}{cells}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
