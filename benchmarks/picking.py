"""The worth of picked labels: ``python -m benchmarks.picking --drives FOLDER --idd FOLDER``.

The truth of drives is held back, frames are picked as `roadeval pick` does, and the number for the
whole drive is compared with the true one, 200 times with another draw. The table is that of
``docs/how-to/pick.md``. ``--drives`` holds the two drives of CamVid, ``--idd`` is ``idd20k_lite``,
of whose train part half of the drives teach, and the frames of the others are taken as one drive;
synthetic drives are rendered.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd

import roadeval
from benchmarks.tables import idd
from benchmarks.world import RenderSettings, write_drive
from roadeval.data import IGNORE, ROAD
from roadeval.evaluation.score.unlabelled import choose_frames, entropy
from roadeval.evaluation.stats.sampling import Estimate, draw_order, estimate
from roadeval.pipeline.stage import View
from roadeval.training.learning import fit

DRAWS: Final = 200
LABELS: Final = (10, 20, 50)
WORST: Final = 10
SECOND: Final = 1_000_000_000
"""Nanoseconds between two frames of IDD, whose stamps are not known."""
SEEDS: Final = (1, 2, 3)
CAMVID: Final = {
    "camvid_0016E5_15hz": {"labels": {"road": [3], "ignore": [11]}},
    "camvid_0006R0_1hz": {},
}
Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Drive:
    """A drive with its truth: of each frame the stamp, the doubt, and the ERR."""

    name: str
    stamps: npt.NDArray[np.int64]
    scores: Values
    errors: Values


def replay_drive(path: Path, preset: str, tables: dict[str, object]) -> Drive:
    """Replay a drive, with its truth to score and without it for the doubt."""
    options = {"record": "none", "figures": False}
    with TemporaryDirectory() as folder:
        for name, hidden in (("scored", {}), ("hidden", {"topics": {"truth": ""}})):
            more = hidden or tables
            settings = {"preset": preset, "training": {"source": "patch"}, **more}
            config = roadeval.configure({**settings, "output": options})
            roadeval.replay(path, config, reports=Path(folder, name))
        rows = roadeval.Result(Path(folder, "scored")).frames
        doubt = pd.read_csv(Path(folder, "hidden", "unlabelled.csv"))
    first = doubt.variant[0]
    doubt = doubt[doubt.variant == first]
    rows = rows[(rows.variant == first) & (rows.stage == doubt.stage.iloc[0])]
    both = doubt.merge(rows[["stamp_ns", "ERR"]], on="stamp_ns").dropna(subset="ERR")
    sign = next(name for name in ("entropy", "disagreement") if both[name].notna().all())
    columns = (both[name].to_numpy() for name in ("stamp_ns", sign, "ERR"))
    return Drive(f"{path.stem}, {preset} ({sign})", *columns)


def of_idd(folder: Path) -> Drive:
    """Return the frames of one half of IDD Lite's drives, by a model that the other half taught."""
    config = roadeval.configure({"preset": "robust"})
    (taught, scored), _ = idd.both_ways(folder)
    frames = [frame for drive in taught.values() for frame in drive]
    model = fit(frames, {"it": config.pipeline}, config.training)
    chain = config.pipeline.bind(model.parameters["it"])
    pairs = []
    for frame in (frame for drive in scored.values() for frame in drive):
        assert frame.truth is not None
        outputs = [result.output for result in chain.run(View.of(frame.image))]
        codes = next(out.probability for out in outputs if out.probability is not None)
        mask = outputs[-1].mask.pixels()
        if (labelled := frame.truth != IGNORE).any():
            wrong = (mask == ROAD)[labelled] != frame.truth[labelled]
            pairs.append((entropy(codes), np.mean(wrong)))
    stamps = np.arange(len(pairs)) * SECOND
    return Drive("IDD Lite, robust taught by other drives (entropy)", stamps, *np.array(pairs).T)


def try_strategies(drive: Drive, labels: int) -> dict[str, tuple[float, float, float]]:
    """Return coverage, median width and worst frames found, in percent, by strategy."""
    count, truth = len(drive.errors), drive.errors.mean()
    worst = {*np.argsort(-drive.errors)[:WORST].tolist()}
    unknown = np.full(count, np.nan)
    draws: dict[str, list[tuple[bool, float, float]]] = {}

    def note(name: str, places: npt.NDArray[np.int64], guess: Estimate) -> None:
        low, high = guess.low, guess.high
        assert low is not None
        assert high is not None
        hits = len(worst & {*places.tolist()}) / WORST
        draws.setdefault(name, []).append((low <= truth <= high, high - low, hits))

    for seed in range(DRAWS):
        random, ranked = choose_frames(drive.stamps, drive.scores, labels, seed)
        random = np.sort(random)
        guess = estimate(drive.errors[random], drive.scores[random], drive.scores)
        note("pick", np.union1d(random, ranked), guess)
        drawn = np.sort(draw_order(count, seed)[:labels])
        note("random", drawn, estimate(drive.errors[drawn], unknown[drawn], unknown))
        start = np.random.default_rng(seed).uniform()
        even = ((np.arange(labels) + start) * count / labels).astype(np.int64)
        note("uniform", even, estimate(drive.errors[even], unknown[even], unknown))
    doubtful = np.sort(np.argsort(-drive.scores)[:labels])
    note("doubtful", doubtful, estimate(drive.errors[doubtful], unknown[doubtful], unknown))
    percent = {name: 100 * np.array(rows, float).T for name, rows in draws.items()}
    return {
        n: (float(h.mean()), float(np.median(w)), float(f.mean()))
        for n, (h, w, f) in percent.items()
    }


def table(drives: list[Drive]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield (
        "| drive, preset (ranked by): true ERR | labels | interval holds, % | its width, points "
        "| of the ten worst found, % |"
    )
    yield "| --- | --- | --- | --- | --- |"
    for drive in drives:
        for labels in LABELS:
            by = try_strategies(drive, labels)
            cells = [
                " / ".join(f"{by[name][place]:.{digits}f}" for name in STRATEGIES)
                for place, digits in ((0, 0), (1, 1), (2, 0))
            ]
            first = (
                f"{drive.name}: {100 * drive.errors.mean():.1f} %" if labels == LABELS[0] else ""
            )
            yield f"| {first} | {labels} | {' | '.join(cells)} |"


STRATEGIES: Final = ("pick", "random", "uniform", "doubtful")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--idd", type=Path, required=True, metavar="FOLDER")
    options = parser.parse_args()
    drives = []
    for name, tables in CAMVID.items():
        path = options.drives / f"{name}.mcap"
        drives += [replay_drive(path, preset, tables) for preset in ("robust", "paper")]
    drives.append(of_idd(options.idd))
    with TemporaryDirectory() as folder:
        for seed in SEEDS:
            path = Path(folder, f"synthetic_{seed}.mcap")
            write_drive(path, RenderSettings(seed=seed))
            drives.append(replay_drive(path, "robust", {}))
    print("\n".join(table(drives)))


if __name__ == "__main__":
    main()
