"""What the presets do on drives that they were not trained on: IDD Lite, split by drive.

    python benchmarks/presets.py [FOLDER] [--frames N] [--seed N]

FOLDER (or the environment's ROADEVAL_IDD) is ``idd20k_lite`` as downloaded; its *train* part alone
is read. Half of the drives train, the other half is scored, then the other way round. Of each
variant it prints the pooled rates of ``post``, the share of truly dark road that is missed, on how
many drives its ERR is not below ``blind``, and the differences to the variant without filter,
with 95 % intervals (bootstrap over drives).
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from dataclasses import replace
from hashlib import blake2b
from pathlib import Path

import cv2
import numpy as np

from roadeval.config import RunConfig, configure
from roadeval.data import IGNORE, NON_ROAD, ROAD, Frame
from roadeval.evaluation.baselines import BlindPrior
from roadeval.pipeline.chain import Chain
from roadeval.pipeline.stage import View
from roadeval.training import fit

TP, TN, FP, FN, DARK, DARK_MISSED = range(6)


def drives(folder: Path, frames: int) -> dict[str, list[Frame]]:
    """Read up to ``frames`` frames of each drive, evenly spread."""
    found = {}
    for drive in sorted((folder / "leftImg8bit" / "train").iterdir()):
        paths = sorted(drive.glob("*_image.jpg"))
        count = min(frames, len(paths))
        chosen = [paths[i * len(paths) // count] for i in range(count)]
        found[drive.name] = [read(path, folder) for path in chosen]
    return found


def read(path: Path, folder: Path) -> Frame:
    """Read a frame; label 0 is road, 255 is ignored."""
    label = path.name.replace("_image.jpg", "_label.png")
    classes = cv2.imread(str(folder / "gtFine" / "train" / path.parent.name / label), 0)
    truth = np.select([classes == 0, classes == 255], [ROAD, IGNORE], NON_ROAD).astype(np.uint8)
    image = np.ascontiguousarray(cv2.imread(str(path))[..., ::-1])
    return Frame(0, 0, 0, image, path.read_bytes(), truth=truth)


def dark_road(frame: Frame) -> np.ndarray:
    """Road darker than half of the 85th percentile of the frame's road."""
    grey, road = frame.image.mean(axis=2), frame.truth == ROAD
    return road & (grey < 0.5 * np.percentile(grey[road], 85)) if road.any() else road


def counts(mask: np.ndarray, frame: Frame) -> np.ndarray:
    """Count a mask's outcomes on a frame, and on its dark road."""
    road, other, dark = frame.truth == ROAD, frame.truth == NON_ROAD, dark_road(frame)
    found = mask > 0
    sets = [road & found, other & ~found, other & found, road & ~found, dark, dark & ~found]
    return np.array([part.sum() for part in sets])


def variants() -> Iterator[tuple[str, RunConfig]]:
    """Yield what is compared; ``unfiltered`` first."""
    paper = configure()
    yield "unfiltered", replace(paper, pipeline=paper.pipeline.without_filter())
    for name in ("paper", "gated", "robust"):
        yield name, configure({"preset": name})


def score(
    name: str, config: RunConfig, seed: int, train: list[Frame], test: dict[str, list[Frame]]
) -> np.ndarray:
    """Train a variant and count its outcomes on each drive, ``(drives, 6)``."""
    model = fit(train, {name: config.pipeline}, replace(config.training, seed=seed))
    chain: Chain = config.pipeline.bind(model.parameters[name])
    return np.array([sum(counts(last(chain, f), f) for f in frames) for frames in test.values()])


def last(chain: Chain, frame: Frame) -> np.ndarray:
    """Give the chain's final mask."""
    *_, (_, output) = chain.run(View.of(frame.image))
    return output.mask.pixels()


def err(total: np.ndarray) -> float:
    """Pooled ERR, in percent; of one drive, or of each of several."""
    return 100 * (total[..., FP] + total[..., FN]) / total[..., :DARK].sum(axis=-1)


def missed(total: np.ndarray) -> float:
    """Share of dark road that is missed, in percent."""
    return 100 * total[DARK_MISSED] / total[DARK]


def not_below(rows: np.ndarray, blind: np.ndarray) -> str:
    """Say on how many of the drives that have an ERR it is not below that of ``blind``."""
    if rows is blind:
        return "-"
    labelled = blind[:, :DARK].any(axis=1)
    worse = err(rows[labelled]) >= err(blind[labelled])
    return f"{worse.sum()} of {len(worse)}"


def difference(rate, new: np.ndarray, base: np.ndarray) -> str:
    """Give a rate's difference with its interval over drives."""

    def of(a: np.ndarray, b: np.ndarray) -> float:
        return rate(a.sum(axis=0)) - rate(b.sum(axis=0))

    draws = np.random.default_rng(0).integers(len(new), size=(1000, len(new)))
    low, high = np.percentile([of(new[drawn], base[drawn]) for drawn in draws], [2.5, 97.5])
    return f"{of(new, base):+6.1f} [{low:+5.1f}, {high:+5.1f}]"


def main() -> None:
    """Run both folds and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=os.environ.get("ROADEVAL_IDD"))
    parser.add_argument("--frames", type=int, default=2, help="of each drive (default 2)")
    parser.add_argument("--seed", type=int, default=0, help="of the training (default 0)")
    options = parser.parse_args()
    if options.folder is None:
        parser.error("name the folder idd20k_lite, or set ROADEVAL_IDD")
    found = drives(Path(options.folder), options.frames)
    halves: list[dict[str, list[Frame]]] = [{}, {}]
    for name, frames in found.items():
        halves[blake2b(name.encode()).digest()[0] % 2][name] = frames
    table: dict[str, list[np.ndarray]] = {}
    for train, test in (halves, halves[::-1]):
        learnt = [frame for frames in train.values() for frame in frames]
        prior = BlindPrior.of_truths([frame.truth for frame in learnt])
        blind = [
            sum(counts(prior.mask(f.image.shape[:2]).pixels(), f) for f in part)
            for part in test.values()
        ]
        table.setdefault("blind", []).append(np.array(blind))
        for name, config in variants():
            table.setdefault(name, []).append(score(name, config, options.seed, learnt, test))
    print_table({name: np.concatenate(parts) for name, parts in table.items()})


def print_table(table: dict[str, np.ndarray]) -> None:
    """Print rates, and differences to ``unfiltered``, in percent and points."""
    base, blind = table["unfiltered"], table["blind"]
    print(
        f"{'variant':12}{'ERR':>6}{'dark missed':>13}{'not below blind':>17}   "
        f"{'ERR - unfiltered':24}dark - unfiltered"
    )
    for name, rows in table.items():
        total = rows.sum(axis=0)
        ends = [difference(rate, rows, base) for rate in (err, missed)]
        print(
            f"{name:12}{err(total):6.2f}{missed(total):13.1f}{not_below(rows, blind):>17}   "
            f"{ends[0]:24}{ends[1]}"
        )


if __name__ == "__main__":
    main()
