"""What a search for slices finds, and how often it names one by chance.

    python -m benchmarks.slices RESULTS... [--drives 200] [--seeds 40]

Conditions are those of real frames: the table ``conditions`` of results folders or recordings.
Errors are made up: a first-order autoregression of ERR's logarithm with a memory of 1 to 50 frames
and heavy tails, and parts of the image that wander by themselves. Null drives have errors that do
not depend on the conditions of their frames, and so have null fleets; their drives err unequally.
Then effects are planted: under one condition, under two, and in a part of the image under one.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import signal

import roadeval
from roadeval.evaluation.score.conditions import QUANTITIES
from roadeval.evaluation.stats.slices import Slice, find_slices

Values = npt.NDArray[np.float64]
Random = np.random.Generator
Plant = Callable[[pd.DataFrame, Values], Values]
"""Returns the factor of each frame's ERR, and of its first part's, ``(2, n)``."""

CONFIDENCE: Final = 0.95
FRAMES: Final = (60, 90, 190, 300, 600, 1000)
MEMORIES: Final = (1, 3, 10, 30, 50)
GROUPS: Final = (16, 24, 40)
EFFECTS: Final = (1.5, 2.0, 3.0)
PIXELS: Final = 100_000
PARTS: Final = 4


def read_conditions(paths: Sequence[Path]) -> list[pd.DataFrame]:
    """Return the conditions of real drives, without the quantities that a drive lacks."""
    tables = [roadeval.Result(path).table("conditions")[[*QUANTITIES]] for path in paths]
    return [table.dropna(axis=1, how="all").bfill() for table in tables if len(table)]


def walk(rng: Random, frames: int, memory: float) -> Values:
    """Return a first-order autoregression of variance 1."""
    rho = np.exp(-1 / memory)
    steps = rng.standard_normal(frames + 1000) * np.sqrt(1 - rho**2)
    values: Values = signal.lfilter([1], [1, -rho], steps)[1000:]
    return values


def stretch(rng: Random, real: pd.DataFrame, frames: int) -> pd.DataFrame:
    """Return conditions of so many frames: a real drive to and fro, from some frame on."""
    there = np.r_[np.arange(len(real)), np.arange(len(real))[::-1]]
    start = rng.integers(len(there))
    return real.iloc[there[(start + np.arange(frames)) % len(there)]].reset_index(drop=True)


def make_drive(
    rng: Random,
    real: pd.DataFrame,
    frames: int,
    memory: float,
    plant: Plant | None = None,
    *,
    name: str = "drive",
    level: float = 0.05,
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Return the rows of frames, conditions and parts of a made-up drive."""
    conditions = stretch(rng, real, frames)
    tails = np.exp(0.2 * np.abs(rng.standard_t(3, frames)))
    error = level * np.exp(0.6 * walk(rng, frames, memory)) * tails
    factors = np.ones((2, frames)) if plant is None else plant(conditions, error)
    key = {"drive": name, "camera": "c", "frame": np.arange(frames)}
    key |= {"stamp_ns": np.arange(frames) * 100_000_000}
    share, parts = PIXELS // PARTS, []
    for part in range(PARTS):
        own = error * factors[0] * np.exp(0.3 * walk(rng, frames, memory) - 0.045)
        own = np.clip(own * factors[1] if part == 0 else own, 0, 1)
        region = {"region": f"part{part}", "wrong": (own * share).astype(int), "N": share}
        parts.append(pd.DataFrame({**key, **region}))
    table = pd.concat(parts, ignore_index=True)
    wrong = table.groupby("frame")["wrong"].sum().to_numpy()
    rows = pd.DataFrame({**key, "FP": wrong, "FN": 0, "N": PIXELS})
    return rows, pd.DataFrame(key).join(conditions), table


def make_fleet(
    rng: Random, reals: Sequence[pd.DataFrame], groups: int, plant: Plant | None = None
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Return the rows of a made-up fleet: drives of 60 frames that err unequally, with a tag."""
    tables: list[list[pd.DataFrame]] = [[], [], []]
    for place in range(groups):
        real = reals[rng.integers(len(reals))]
        level = 0.05 * np.exp(0.5 * np.clip(rng.standard_t(3), -4, 4))
        memory = rng.choice(MEMORIES)
        made = make_drive(rng, real, 60, memory, plant, name=f"d{place:03d}", level=level)
        made[1]["group"], made[1]["tag_weather"] = f"d{place:03d}", rng.choice(["dry", "rain"])
        for table, rows in zip(tables, made, strict=True):
            table.append(rows)
    frames, conditions, parts = (pd.concat(rows, ignore_index=True) for rows in tables)
    return frames, conditions, parts


def plants(
    effect: float, reals: Sequence[pd.DataFrame], first: str = "brightness", other: str = "change"
) -> Iterator[tuple[str, str, Plant]]:
    """Yield the kinds of planted effects: a name, the quantity, and the factors."""
    of_all = pd.concat(reals)

    def inside(frames: pd.DataFrame, name: str, share: float) -> npt.NDArray[np.bool_]:
        return (frames[name] > of_all[name].quantile(1 - share)).to_numpy()

    def one(frames: pd.DataFrame, error: Values) -> Values:
        factor = np.where(inside(frames, first, 0.4), effect, 1)
        return np.array([factor, np.ones_like(error)])

    def two(frames: pd.DataFrame, error: Values) -> Values:
        both = inside(frames, first, 0.6) & inside(frames, other, 0.6)
        return np.array([np.where(both, effect, 1), np.ones_like(error)])

    def part(frames: pd.DataFrame, error: Values) -> Values:
        factor = np.where(inside(frames, first, 0.4), effect, 1)
        return np.array([np.ones_like(error), factor])

    yield "one", first, one
    yield "two", first, two
    yield "part", "part0", part


def names(slices: Sequence[Slice], what: str) -> bool:
    """Return whether any slice has the planted quantity or part."""
    return any(
        what == found.part or any(what == condition.quantity for condition in found.conditions)
        for found in slices
    )


def main() -> None:
    """Simulate, and print two tables in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", nargs="+", type=Path)
    parser.add_argument("--drives", type=int, default=200)
    parser.add_argument("--seeds", type=int, default=40)
    asked = parser.parse_args()
    reals = read_conditions(asked.results)
    null_drives = null_fleets = 0
    for seed in range(asked.drives):
        rng = np.random.default_rng([1, seed])
        real, frames = reals[seed % len(reals)], FRAMES[seed % len(FRAMES)]
        made = make_drive(rng, real, frames, MEMORIES[seed % len(MEMORIES)])
        null_drives += bool(find_slices(*made, CONFIDENCE))
        fleet = make_fleet(np.random.default_rng([2, seed]), reals, GROUPS[seed % len(GROUPS)])
        null_fleets += bool(find_slices(*fleet, CONFIDENCE, over_drives=True))
    print(f"{null_drives} of {asked.drives} null drives name a slice, {null_fleets} null fleets.\n")
    print("| planted | of | effect | names a slice, % | with what was planted, % |")
    print("|---|---|--:|--:|--:|", flush=True)
    for effect in EFFECTS:
        for kind in ("one", "two", "part"):
            for size in (90, 300, 1000, "24 drives"):
                runs = []
                for seed in range(asked.seeds):
                    rng, real = np.random.default_rng([3, seed]), reals[seed % len(reals)]
                    of_drive = not isinstance(size, str)
                    planted = {
                        k: rest for k, *rest in plants(effect, [real] if of_drive else reals)
                    }
                    what, plant = planted[kind]
                    if isinstance(size, str):
                        made = make_fleet(rng, reals, 24, plant)
                    else:
                        made = make_drive(rng, real, size, MEMORIES[seed % 3], plant)
                    slices = find_slices(*made, CONFIDENCE, over_drives=not of_drive)
                    runs.append((bool(slices), names(slices, what)))
                found, right = 100 * np.mean(runs, axis=0)
                of = size if isinstance(size, str) else f"{size} frames"
                print(f"| {kind} | {of} | {effect} | {found:.0f} | {right:.0f} |", flush=True)


if __name__ == "__main__":
    main()
