"""How often intervals hold, and what they find: ``python -m benchmarks.intervals``.

Drives are made up, so that the truth is known, and given to the functions that `roadeval` uses. The
table is that of INTERVALS.md. Below it is a null run: five
variants that are as good as the base, and how many drives have a false finding among them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import signal, special, stats

from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import holm, mean_distribution, within_drive

Drives = npt.NDArray[np.float64]
"""``(drives, frames)`` differences of mean 0 and variance 1."""
Process = Callable[[np.random.Generator, int, int], Drives]
Judged = tuple[npt.NDArray[np.bool_], npt.NDArray[np.float64]]
"""Whether each interval holds each of some values, ``(drives, values)``; and its width."""

CONFIDENCE: Final = 0.95
EFFECTS: Final = (1, 2)
"""True differences that are to be found, in standard deviations of a frame's difference."""
WARM_UP: Final = 1000


# --- Made-up drives -------------------------------------------------------------------------------


def autoregression(rho: float, noise: Callable[..., Drives] | None = None) -> Process:
    """Return drives of a first-order autoregression, normal unless another noise is given."""

    def make(rng: np.random.Generator, drives: int, frames: int) -> Drives:
        shape = (drives, frames + WARM_UP)
        steps = rng.standard_normal(shape) if noise is None else noise(rng, shape)
        made: Drives = signal.lfilter([1], [1, -rho], steps)[:, WARM_UP:] * np.sqrt(1 - rho**2)
        return made

    return make


def laplace(rng: np.random.Generator, shape: tuple[int, int]) -> Drives:
    """Return noise of variance 1 with tails that fall exponentially."""
    return rng.laplace(size=shape) / np.sqrt(2)


def student3(rng: np.random.Generator, shape: tuple[int, int]) -> Drives:
    """Return noise of variance 1 with tails as heavy as Student's of three degrees."""
    return rng.standard_t(3, size=shape) / np.sqrt(3)


def drift(rho: float, share: float = 0.5) -> Process:
    """Return slow drives of which all but a share of the variance is noise on each frame."""

    def make(rng: np.random.Generator, drives: int, frames: int) -> Drives:
        slow = autoregression(rho)(rng, drives, frames)
        noise = rng.standard_normal((drives, frames))
        return np.sqrt(share) * slow + np.sqrt(1 - share) * noise

    return make


def two_memories(rng: np.random.Generator, drives: int, frames: int) -> Drives:
    """Return drives with a slow part, a quicker one and noise: more than a drive can show."""
    slow, quick = (autoregression(rho)(rng, drives, frames) for rho in (0.98, 0.7))
    noise = rng.standard_normal((drives, frames))
    return np.sqrt(0.4) * slow + np.sqrt(0.3) * quick + np.sqrt(0.3) * noise


def bursts(rng: np.random.Generator, drives: int, frames: int) -> Drives:
    """Return drives with little on most frames and, now and then, a stretch of differences."""
    above, tail = 0.5, stats.norm.sf(0.5)
    mean = stats.norm.pdf(above) - above * tail
    square = (1 + above**2) * tail - above * stats.norm.pdf(above)
    made = np.maximum(autoregression(0.9)(rng, drives, frames) - above, 0)
    return (made - mean) / np.sqrt(square - mean**2)


CELLS: Final[tuple[tuple[str, Process, tuple[int, ...]], ...]] = (
    ("independent", autoregression(0), (60, 91, 3000)),
    ("AR 0.5", autoregression(0.5), (60, 91, 600)),
    ("AR 0.8", autoregression(0.8), (60, 91, 190)),
    ("AR 0.9", autoregression(0.9), (60, 91, 190, 600)),
    ("AR 0.95", autoregression(0.95), (60, 91, 190, 600, 3000)),
    ("AR 0.8, Laplace", autoregression(0.8, laplace), (91, 600)),
    ("AR 0.8, t3", autoregression(0.8, student3), (91, 600)),
    ("slow 0.95 + noise", drift(0.95), (91, 190, 600, 3000)),
    ("slow 0.98 + noise", drift(0.98), (190, 600, 3000)),
    ("two memories", two_memories, (190, 600)),
    ("bursts", bursts, (91, 190, 600, 3000)),
    ("bursts, reversed", lambda *of: -bursts(*of), (91, 190)),
)


# --- Intervals ------------------------------------------------------------------------------------


def ours(drives: Drives, values: npt.NDArray[np.float64]) -> Judged:
    """Judge the intervals that `roadeval` gives."""
    held = np.empty((len(drives), len(values)), bool)
    widths = np.empty(len(drives))
    for place, series in enumerate(drives):
        found = mean_distribution(series)
        low, high = found.interval(CONFIDENCE)
        held[place] = (low <= values) & (values <= high)
        widths[place] = high - low
    return held, widths


def naive(drives: Drives, values: npt.NDArray[np.float64]) -> Judged:
    """Judge Student's intervals, which take the frames for independent."""
    frames = drives.shape[1]
    error = drives.std(axis=1, ddof=1) / np.sqrt(frames)
    return _centred(drives, special.stdtrit(frames - 1, (1 + CONFIDENCE) / 2) * error, values)


def wider_of_two(drives: Drives, values: npt.NDArray[np.float64]) -> Judged:
    """Judge the wider of two intervals that are easier to explain, for comparison.

    One is Student's with the effective frames of an autoregression, its coefficient freed of bias
    (Kendall 1954); the other that of Kiefer and Vogelsang (2002) with Bartlett's kernel over the
    whole drive.
    """
    frames = drives.shape[1]
    centred = drives - drives.mean(axis=1, keepdims=True)
    rho = (centred[:, 1:] * centred[:, :-1]).sum(axis=1) / (centred**2).sum(axis=1)
    rho = np.minimum(np.maximum(rho, 0) + (1 + 3 * np.maximum(rho, 0)) / frames, 1)
    worth = frames * (1 - rho) / (1 + rho)
    with np.errstate(all="ignore"):
        quantile = special.stdtrit(np.maximum(worth - 1, 1e-9), (1 + CONFIDENCE) / 2)
        student = quantile * drives.std(axis=1, ddof=1) / np.sqrt(worth)
    sums = (np.cumsum(centred, axis=1) ** 2).sum(axis=1)
    fixed_b = 4.771 * np.sqrt(2 * sums / frames**3)
    return _centred(drives, np.maximum(np.where(worth > 1, student, np.inf), fixed_b), values)


def _centred(
    drives: Drives, half: npt.NDArray[np.float64], values: npt.NDArray[np.float64]
) -> Judged:
    away = np.abs(drives.mean(axis=1)[:, None] - values)
    return away <= half[:, None], 2 * half


# --- Tables ---------------------------------------------------------------------------------------


def rows(repetitions: int) -> Iterator[str]:
    """Yield the lines of the table."""
    rule = f"{'=' * 17}  ======  =====" + 2 * "  ====  =======  ====="
    yield rule
    yield f"{'':17}  {'':6}  naive  wider of two         {'':6}ours"
    yield f"{'':17}  {'':6}  -----" + 2 * "  --------------------"
    yield f"{'drives':17}  frames  holds" + 2 * "  hold  finds    width"
    yield rule
    # An effect that is there moves the drive; here 0 moves instead.
    values = -np.array([0.0, *EFFECTS])
    for number, (name, process, lengths) in enumerate(CELLS):
        for frames in lengths:
            drives = process(np.random.default_rng([number, frames]), repetitions, frames)
            held, _ = naive(drives, values)
            shown = "  ".join(_cells(*method(drives, values)) for method in (wider_of_two, ours))
            yield f"{name:17}  {frames:6}  {100 * held[:, 0].mean():5.0f}  {shown}"
    yield rule


def _cells(held: npt.NDArray[np.bool_], widths: npt.NDArray[np.float64]) -> str:
    """Return coverage, power at each effect and median width; no width for an infinite one."""
    missed = 100 * (1 - held.mean(axis=0))
    power = "/".join(f"{share:.0f}" for share in missed[1:])
    return f"{100 - missed[0]:4.0f}  {power:>7}  {np.median(widths):5.2f}"


def false_findings(drives: int, variants: int, rho: float = 0.8, frames: int = 91) -> str:
    """Return on how many drives of variants that change nothing at least one seems to."""
    settings, rng = EvaluationSettings(), np.random.default_rng(2013)
    base = np.full(frames, 0.2)
    plain = corrected = 0
    for _ in range(drives):
        rates = base + 0.01 * autoregression(rho)(rng, variants, frames)
        family = holm([within_drive(each, base, settings) for each in rates])
        plain += any(each.p < 1 - settings.confidence for each in family)
        corrected += any(each.p_holm < 1 - settings.confidence for each in family)
    return (
        f"{variants} variants without effect, {drives} drives of {frames} frames, AR {rho}: "
        f"a false finding on {100 * plain / drives:.1f} %, {100 * corrected / drives:.1f} % after "
        "Holm's correction"
    )


def main() -> None:
    """Print both."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repetitions", type=int, default=2000, help="drives a line")
    options = parser.parse_args()
    for line in rows(options.repetitions):
        print(line, flush=True)
    for rho in (0.0, 0.8, 0.9):
        print(false_findings(min(options.repetitions, 1000), 5, rho), flush=True)


if __name__ == "__main__":
    main()
