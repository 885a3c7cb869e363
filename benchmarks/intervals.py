"""How often a drive's intervals hold, and what they find: ``python -m benchmarks.intervals``.

Drives are made up, so that their truth is known, and passed to the function of `roadeval` and to
those of textbooks. ``--write`` puts the table into INTERVALS.md. Below it is a null run: five
variants that are as good as the base, and how many drives have a false finding among them.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import signal, special, stats

from roadeval.evaluation.stats.autocorrelation import mean_distribution
from roadeval.evaluation.stats.difference import holm, interval

Values = npt.NDArray[np.float64]
Drives = Values
"""``(drives, frames)`` differences of mean 0 and variance 1."""
Process = Callable[[np.random.Generator, int, int], Drives]

CONFIDENCE: Final = 0.95
EFFECTS: Final = (1, 2)
"""True differences to find, in standard deviations of a frame's difference."""
FAMILY: Final = 20
"""Comparisons that are corrected together where the least p-value is to be below 0.05 / 20."""
WARM_UP: Final = 1000
PAGE: Final = Path(__file__).with_name("INTERVALS.md")


# --- Made-up drives -------------------------------------------------------------------------------


def autoregression(rho: float, noise: Callable[..., Drives] | None = None) -> Process:
    """Return drives of a first-order autoregression, normal unless another noise is given."""

    def make(rng: np.random.Generator, drives: int, frames: int) -> Drives:
        shape = (drives, frames + WARM_UP)
        steps = rng.standard_normal(shape) if noise is None else noise(rng, shape)
        made: Drives = signal.lfilter([1], [1, -rho], steps)[:, WARM_UP:] * np.sqrt(1 - rho**2)
        return made

    return make


def exponential(rng: np.random.Generator, shape: tuple[int, int]) -> Drives:
    """Return skewed noise of mean 0 and variance 1."""
    return rng.exponential(size=shape) - 1


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


def bursts(above: float) -> Process:
    """Return drives with nothing on most frames and, now and then, a stretch of differences.

    The higher ``above``, the rarer they are: at 0.5 they are on 31 % of the frames, at 1.5 on 7 %.
    """

    def make(rng: np.random.Generator, drives: int, frames: int) -> Drives:
        tail, density = stats.norm.sf(above), stats.norm.pdf(above)
        mean = density - above * tail
        square = (1 + above**2) * tail - above * density
        made = np.maximum(autoregression(0.9)(rng, drives, frames) - above, 0)
        return (made - mean) / np.sqrt(square - mean**2)

    return make


CELLS: Final[tuple[tuple[str, Process, tuple[int, ...]], ...]] = (
    ("independent", autoregression(0), (60, 91, 3000)),
    ("AR 0.5", autoregression(0.5), (60, 91, 600)),
    ("AR 0.5, exponential", autoregression(0.5, exponential), (60, 190)),
    ("AR 0.8", autoregression(0.8), (60, 91, 190)),
    ("AR 0.8, t3", autoregression(0.8, student3), (91, 600)),
    ("AR 0.9", autoregression(0.9), (60, 91, 190, 600)),
    ("AR 0.95", autoregression(0.95), (91, 190, 600, 3000)),
    ("slow 0.95 + noise", drift(0.95), (60, 91, 190, 600, 3000)),
    ("slow 0.98 + noise", drift(0.98), (190, 600, 3000)),
    ("slow 0.99 + 75 % noise", drift(0.99, 0.25), (190, 600, 3000)),
    ("two memories", two_memories, (190, 600)),
    ("bursts", bursts(0.5), (60, 91, 190, 600, 3000)),
    ("bursts, reversed", lambda *drives: -bursts(0.5)(*drives), (91, 190)),
    ("rare bursts", bursts(1.5), (91, 190, 600, 3000)),
)


# --- Intervals of textbooks: the ends, ``(2, drives)`` --------------------------------------------


def bootstrap(drives: Drives) -> Values:
    """Return percentiles of the means of frames that are drawn anew with replacement."""
    frames = drives.shape[1]
    draws = np.random.default_rng(1).multinomial(frames, np.full(frames, 1 / frames), 999)
    tail = (1 - CONFIDENCE) / 2
    ends: Values = np.quantile(draws @ drives.T / frames, (tail, 1 - tail), axis=0)
    return ends


def hac(drives: Drives) -> Values:
    """Return the interval of Newey and West (1987), with their rule for the lags."""
    frames = drives.shape[1]
    centred, lags = _centred(drives), int(4 * (frames / 100) ** (2 / 9))
    variance = (centred**2).mean(axis=1)
    for lag in range(1, lags + 1):
        product = (centred[:, lag:] * centred[:, :-lag]).sum(axis=1) / frames
        variance += 2 * (1 - lag / (lags + 1)) * product
    return _around(drives, special.ndtri((1 + CONFIDENCE) / 2) * np.sqrt(variance / frames))


def effective_size(drives: Drives) -> Values:
    """Return Student's interval with the effective frames of a first-order autoregression.

    Its coefficient is freed of bias (Kendall 1954).
    """
    frames, centred = drives.shape[1], _centred(drives)
    rho = (centred[:, 1:] * centred[:, :-1]).sum(axis=1) / (centred**2).sum(axis=1)
    rho = np.minimum(np.maximum(rho, 0) + (1 + 3 * np.maximum(rho, 0)) / frames, 1)
    worth = np.maximum(frames * (1 - rho) / (1 + rho), 1.001)
    quantile = special.stdtrit(worth - 1, (1 + CONFIDENCE) / 2)
    return _around(drives, quantile * drives.std(axis=1, ddof=1) / np.sqrt(worth))


def fixed_b(drives: Drives) -> Values:
    """Return the interval of Kiefer and Vogelsang (2002): Bartlett's kernel over all lags."""
    sums = (np.cumsum(_centred(drives), axis=1) ** 2).sum(axis=1)
    return _around(drives, 4.771 * np.sqrt(2 * sums / drives.shape[1] ** 3))


TEXTBOOK: Final = {"bootstrap": bootstrap, "HAC": hac, "AR": effective_size, "fixed-b": fixed_b}


def _centred(drives: Drives) -> Drives:
    return drives - drives.mean(axis=1, keepdims=True)


def _around(drives: Drives, half: Values) -> Values:
    return drives.mean(axis=1) + np.array([-1, 1])[:, None] * half


# --- Tables ---------------------------------------------------------------------------------------


def rows(repetitions: int) -> Iterator[str]:
    """Yield the lines of the table."""
    names = ["drives", "frames", *TEXTBOOK, "ours", "width", "finds", "false of 20", "finds of 20"]
    yield f"| {' | '.join(names)} |"
    yield f"|---|{'--:|' * (len(names) - 1)}"
    for number, (name, process, lengths) in enumerate(CELLS):
        for frames in lengths:
            drives = process(np.random.default_rng([number, frames]), repetitions, frames)
            with np.errstate(invalid="ignore"):
                ends = [method(drives) for method in TEXTBOOK.values()]
            shares = [100 * ((low <= 0) & (high >= 0)).mean() for low, high in ends]
            hold = "".join(f" {share:.0f} |" for share in shares)
            yield f"| {name} | {frames} |{hold}{_ours(drives)}"


def _ours(drives: Drives) -> str:
    """Return the cells of `mean_distribution`: an effect moves the drive, here 0 moves instead."""
    means = [mean_distribution(series) for series in drives]
    width = np.median([np.ptp(mean.interval(CONFIDENCE)) for mean in means])
    p = np.array([[mean.p_value(-effect) for effect in (0, *EFFECTS)] for mean in means])
    held, *sure = 100 * (p >= 1 - CONFIDENCE).mean(axis=0)
    false, family, _ = 100 * (p < (1 - CONFIDENCE) / FAMILY).mean(axis=0)
    finds = "/".join(f"{100 - share:.0f}" for share in sure)
    return f" {held:.0f} | {width:.2f} | {finds} | {false:.1f} | {family:.0f} |"


def false_findings(drives: int, variants: int, rho: float = 0.8, frames: int = 91) -> str:
    """Return on how many drives of variants that change nothing at least one seems to."""
    rng = np.random.default_rng(2013)
    plain = corrected = 0
    for _ in range(drives):
        family = holm([interval(series) for series in autoregression(rho)(rng, variants, frames)])
        plain += any(difference.p < 1 - CONFIDENCE for difference in family)
        corrected += any(difference.p_holm < 1 - CONFIDENCE for difference in family)
    return (
        f"{variants} variants without effect, {drives} drives of {frames} frames, AR {rho}: "
        f"a false finding on {100 * plain / drives:.1f} %, {100 * corrected / drives:.1f} % after "
        "Holm's correction"
    )


def show(name: str, lines: Iterable[str], *, write: bool, page: Path = PAGE) -> None:
    """Print a table and, where that is wanted, write it between its marks in a page."""
    table = []
    for line in lines:
        print(line, flush=True)
        table.append(line)
    if write:
        block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = "\n{}\n\n".format("\n".join(table))
        written = block.sub(lambda marks: marks[1] + text + marks[2], page.read_text("utf-8"))
        page.write_text(written, "utf-8")


def main() -> None:
    """Print both."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repetitions", type=int, default=1000, help="drives a line")
    parser.add_argument("--write", action="store_true", help="into INTERVALS.md, too")
    options = parser.parse_args()
    show("drives", rows(options.repetitions), write=options.write)
    null = [false_findings(options.repetitions, 5, rho) for rho in (0.0, 0.8, 0.9)]
    show("null", (f"- {line}" for line in null), write=options.write)


if __name__ == "__main__":
    main()
