"""How often a fleet's intervals hold, and what they find: ``python -m benchmarks.fleet_intervals``.

Fleets are made up, so that their truth is known, and passed to the function that `roadeval` uses.
``--write`` puts the table into INTERVALS.md.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import special

from benchmarks.intervals import show
from roadeval.evaluation.stats.difference import group_means, over_drives

Values = npt.NDArray[np.float64]
Draw = Callable[[np.random.Generator, int], Values]
"""Draws so many effects of mean 0 and variance 1."""

CONFIDENCE: Final = 0.95
TAIL: Final = (1 - CONFIDENCE) / 2
GROUPS: Final = (6, 10, 30, 200)
POWER: Final = (0.5, 1)
"""True means to find, in standard deviations of a drive's effect."""
SCALE: Final = 0.02
"""Standard deviation of an effect, as a rate."""


# --- Made-up fleets -------------------------------------------------------------------------------

EFFECTS: Final[dict[str, Draw]] = {
    "normal": lambda rng, count: rng.standard_normal(count),
    "t3": lambda rng, count: rng.standard_t(3, count) / math.sqrt(3),
    "skewed": lambda rng, count: rng.exponential(size=count) - 1,
}


@dataclass(frozen=True)
class Layout:
    """Properties of drives, without their effects.

    ``least`` and ``most`` are the drives' own standard errors, in standard deviations of an effect.
    Groups have 1 to ``drives`` drives, which share half of the variance if there are several.
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


def fleet(rng: np.random.Generator, draw: Draw, layout: Layout, groups: int) -> pd.DataFrame:
    """Make up a fleet whose mean is 0 and whose drives differ by 1, in `SCALE`."""
    sizes = rng.integers(1, layout.drives + 1, groups)
    group = np.repeat(np.arange(groups), sizes)
    errors = np.exp(rng.uniform(math.log(layout.least), math.log(layout.most), len(group)))
    measured = _effects(rng, draw, layout, group) + errors * rng.standard_normal(len(group))
    return pd.DataFrame({"drive": range(len(group)), "group": group, "mean": SCALE * measured})


def _effects(
    rng: np.random.Generator, draw: Draw, layout: Layout, group: npt.NDArray[np.int64]
) -> Values:
    if layout.drives == 1:
        return draw(rng, len(group))
    shared = draw(rng, int(group.max()) + 1)[group]
    return (shared + draw(rng, len(group))) / math.sqrt(2)


# --- The table ------------------------------------------------------------------------------------


def judge(rng: np.random.Generator, draw: Draw, layout: Layout, groups: int) -> list[float]:
    """Make a fleet: whether Student's interval and ours hold, ours is sure, and ours' width."""
    effects = fleet(rng, draw, layout, groups)
    means, ours = group_means(effects) / SCALE, over_drives(effects, CONFIDENCE)
    half = special.stdtrit(groups - 1, 1 - TAIL) * means.std(ddof=1) / math.sqrt(groups)
    low, high = ours.low / SCALE, ours.high / SCALE
    # A true effect moves the fleet; here 0 moves instead.
    sure = [100.0 * (not low <= -effect <= high) for effect in POWER]
    return [100.0 * (abs(means.mean()) <= half), 100.0 * (low <= 0 <= high), *sure, high - low]


def rows(repetitions: int) -> Iterator[str]:
    """Yield the lines of the table."""
    names = ["effect", "drives", "n", "Student's", "ours", *(f"at {at}" for at in POWER), "width"]
    yield f"| {' | '.join(names)} |"
    yield f"|---|---|{'--:|' * (len(names) - 2)}"
    for kind, (name, draw) in enumerate(EFFECTS.items()):
        for place, layout in enumerate(LAYOUTS):
            for groups in GROUPS:
                rng = np.random.default_rng([kind, place, groups])
                results = [judge(rng, draw, layout, groups) for _ in range(repetitions)]
                *shares, widths = np.array(results).T
                cells = "".join(f" {share.mean():.0f} |" for share in shares)
                yield f"| {name} | {layout.name} | {groups} |{cells} {np.median(widths):.2f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repetitions", type=int, default=1000, help="fleets a line")
    parser.add_argument("--write", action="store_true", help="into INTERVALS.md, too")
    options = parser.parse_args()
    show("fleets", rows(options.repetitions), write=options.write)


if __name__ == "__main__":
    main()
