"""How often a fleet's intervals hold, and what they find: ``python -m benchmarks.fleet_intervals``.

Fleets are made up, so that the truth is known, and given to the function that `roadeval` uses. The
table is the one that `roadeval.evaluation.drives.across` quotes and explains.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import special

from roadeval.evaluation.drives import AcrossSettings, DriveEffect, across_drives
from roadeval.evaluation.drives.bootstrap import pooled_counts, pooled_difference, resampled
from roadeval.evaluation.drives.effect import Clusters
from roadeval.evaluation.drives.spread import tau_squared

Values = npt.NDArray[np.float64]
Draw = Callable[[np.random.Generator, int], Values]
"""Draws so many effects of mean 0 and variance 1."""

SETTINGS: Final = AcrossSettings(resamples=1000)
TAIL: Final = (1 - SETTINGS.confidence) / 2
CLUSTERS: Final = (6, 10, 30, 200)
POWER: Final = (0.5, 1)
"""True means that are to be found, in standard deviations of a drive's effect."""
SCALE: Final = 0.02
"""That standard deviation, as a rate."""
NEW: Final = 1000
"""New drives, of which a share is held."""


# --- Made-up fleets -------------------------------------------------------------------------------

EFFECTS: Final[dict[str, Draw]] = {
    "normal": lambda rng, count: rng.standard_normal(count),
    "t3": lambda rng, count: rng.standard_t(3, count) / math.sqrt(3),
    "skewed": lambda rng, count: rng.exponential(size=count) - 1,
}


@dataclass(frozen=True)
class Layout:
    """What drives are like, their effects aside.

    ``least`` and ``most`` are the drives' own standard errors, in standard deviations of an effect;
    a drive has as many pixels as make its error. Groups have 1 to ``drives`` drives, which share
    half of the variance where that is more than one.
    """

    name: str
    least: float
    most: float
    drives: int = 1


LAYOUTS: Final = (
    Layout("errors 0.3", 0.3, 0.3),
    Layout("errors 0.1 to 3", 0.1, 3),
    Layout("groups of 1 to 7", 0.1, 1, 7),
)


def fleet(rng: np.random.Generator, draw: Draw, layout: Layout, groups: int) -> list[DriveEffect]:
    """Make up a fleet whose mean is 0 and whose drives differ by 1, in `SCALE`."""
    sizes = rng.integers(1, layout.drives + 1, groups)
    group = np.repeat(np.arange(groups), sizes)
    errors = np.exp(rng.uniform(math.log(layout.least), math.log(layout.most), len(group)))
    measured = _effects(rng, draw, layout, group) + errors * rng.standard_normal(len(group))
    # The base is wrong in half of all pixels, so that no rate leaves 0 to 1.
    labelled = np.round(1e6 / errors**2).astype(int)
    wrong = np.round((0.5 + SCALE * measured) * labelled).astype(int)
    return [
        DriveEffect(
            *(f"{place:05}", f"{group[place]:05}", SCALE * measured[place]),
            *(SCALE * errors[place], 100),
            (labelled[place] // 2, labelled[place]),
            (wrong[place], labelled[place]),
        )
        for place in range(len(group))
    ]


def _effects(
    rng: np.random.Generator, draw: Draw, layout: Layout, group: npt.NDArray[np.int64]
) -> Values:
    if layout.drives == 1:
        return draw(rng, len(group))
    shared = draw(rng, int(group.max()) + 1)[group]
    return (shared + draw(rng, len(group))) / math.sqrt(2)


# --- Other intervals, for comparison --------------------------------------------------------------


def student(clusters: Clusters) -> tuple[float, float]:
    """Return Student's interval of the mean."""
    means = clusters.group_means()
    half = special.stdtrit(len(means) - 1, 1 - TAIL) * means.std(ddof=1) / math.sqrt(len(means))
    return means.mean() - half, means.mean() + half


def bootstraps(clusters: Clusters) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the plain percentile interval of the pooled difference, and the BCa interval."""
    counts = pooled_counts(clusters)
    drawn, whole = resampled(counts, SETTINGS), pooled_difference(counts.sum(axis=0))
    without = pooled_difference(counts.sum(axis=0) - counts)
    away = without.mean() - without
    acceleration = (away**3).sum() / (6 * (away**2).sum() ** 1.5)
    bias = special.ndtri(((drawn < whole).mean() + (drawn <= whole).mean()) / 2)
    shifted = bias + special.ndtri([TAIL, 1 - TAIL])
    levels = special.ndtr(bias + shifted / (1 - acceleration * shifted))
    plain, bca = np.quantile(drawn, [TAIL, 1 - TAIL]), np.quantile(drawn, levels)
    return (plain[0], plain[1]), (bca[0], bca[1])


def q_profile(effects: list[DriveEffect]) -> tuple[float, float]:
    """Return the interval of tau that takes drives for normal, and groups for nothing."""
    measured = np.array([[each.mean for each in effects]])
    variances = np.array([[each.standard_error for each in effects]]) ** 2
    targets = special.chdtri(len(effects) - 1, [[TAIL, 1 - TAIL]])
    low, high = np.sqrt(tau_squared(measured, variances, targets)[0])
    return low, high


# --- Tables ---------------------------------------------------------------------------------------

COLUMNS: Final[tuple[tuple[str, dict[str, int]], ...]] = (
    ("mean", {"t": 3, "ours": 4, "at .5": 5, "at 1": 4, "width": 5}),
    ("pooled", {"plain": 5, "BCa": 3, "ours": 4}),
    ("tau", {"plain": 5, "ours": 4, "found": 5}),
    ("new", {"ours": 4}),
)
"""What is judged, and in which columns of how many characters. "at" is how often a true mean is
found; the rest, but for the mean's width and the tau that is found, how often an interval holds,
all in percent."""
WIDTHS: Final = tuple(width for _, own in COLUMNS for width in own.values())
WITH_FRACTION: Final = ("width", "found")


def judged(rng: np.random.Generator, draw: Draw, layout: Layout, groups: int) -> list[float]:
    """Make a fleet, and return what the columns are the averages of."""
    effects = fleet(rng, draw, layout, groups)
    clusters, found = Clusters.of(effects), across_drives(effects, SETTINGS)
    low, high, spread = found.low / SCALE, found.high / SCALE, found.spread
    plain, bca = bootstraps(clusters)
    new = SCALE * _effects(rng, draw, layout, np.arange(NEW))
    pooled = (found.pooled_low, found.pooled_high)
    shares = [
        _holds(student(clusters), 0),
        _holds((low, high), 0),
        # An effect that is there moves the fleet; here 0 moves instead.
        *(1 - _holds((low, high), -effect) for effect in POWER),
        *(_holds(ends, 0) for ends in (plain, bca, pooled)),
        *(_holds(ends, SCALE) for ends in (q_profile(effects), (spread.tau_low, spread.tau_high))),
        np.mean((spread.new_low <= new) & (new <= spread.new_high)),
    ]
    percent = [100 * float(share) for share in shares]
    return [*percent[:4], high - low, *percent[4:9], spread.tau / SCALE, percent[9]]


def _holds(ends: tuple[float, float], value: float) -> float:
    return float(ends[0] <= value <= ends[1])


def rows(repetitions: int) -> Iterator[str]:
    """Yield the lines of the table."""
    spans = [(name, sum(own.values()) + len(own) - 1) for name, own in COLUMNS]
    rule = f"{'=' * 6}  {'=' * 16}  ===" + "".join(f" {'=' * width}" for width in WIDTHS)
    yield rule
    yield f"{'':29}" + "".join(f" {name:{width}}" for name, width in spans).rstrip()
    yield "-" * 29 + "".join(f" {'-' * width}" for _, width in spans)
    names = [f" {name:>{width}}" for _, own in COLUMNS for name, width in own.items()]
    yield f"{'effect':6}  {'drives':16}  {'n':>3}" + "".join(names)
    yield rule
    for kind, (name, draw) in enumerate(EFFECTS.items()):
        for place, layout in enumerate(LAYOUTS):
            for groups in CLUSTERS:
                rng = np.random.default_rng([kind, place, groups])
                results = [judged(rng, draw, layout, groups) for _ in range(repetitions)]
                yield f"{name:6}  {layout.name:16}  {groups:3}{_cells(np.array(results))}"
    yield rule


def _cells(results: Values) -> str:
    """Return the columns' averages, and the width's median."""
    shown = []
    names = [name for _, own in COLUMNS for name in own]
    for name, width, values in zip(names, WIDTHS, results.T, strict=True):
        value = np.median(values) if name == "width" else values.mean()
        shown.append(f" {value:{width}.{2 if name in WITH_FRACTION else 0}f}")
    return "".join(shown)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repetitions", type=int, default=1000, help="fleets a line")
    options = parser.parse_args()
    for line in rows(options.repetitions):
        print(line, flush=True)


if __name__ == "__main__":
    main()
