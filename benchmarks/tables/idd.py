"""The presets on drives that they were not trained on: IDD Lite, split by drive.

Half of the drives of its *train* part learn, the other half is scored, then the other way round.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import blake2b
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from roadeval.config.run import RunConfig, configure
from roadeval.data import IGNORE, NON_ROAD, ROAD, Frame
from roadeval.evaluation.score.frame import BlindPrior
from roadeval.pipeline.beyond.features import GROUPS
from roadeval.pipeline.chain import Chain
from roadeval.pipeline.stage import View
from roadeval.training.learning import fit

SOURCE: Final = "https://github.com/Siya26/Semantic-Segmentation-on-IDD_Lite"
DRAWS: Final = 1000
"""Draws of the bootstrap over drives."""
SEEDS_OF_ROBUST: Final = 3
"""Its trainings take longer."""
FEWER_PIXELS: Final = 20_000
"""Pixels of each of many trainings; `robust` takes more."""
VARIANTS: Final = ("unfiltered", "paper", "gated", "robust")
FILTER_ALONE: Final = ("gated", "similarity", "svm", "post")
"""The chain of the preset `gated` without exposure, as measured here."""
UNLABELLED: Final = "unlabelled"
"""`robust` taught by the reference patch, without any label."""
TP, TN, FP, FN, DARK, DARK_MISSED = range(6)

Counted = NDArray[np.int64]
"""Outcomes of a variant on each drive, ``(drives, 6)``."""
Drives = Mapping[str, Sequence[Frame]]
Fold = tuple[Drives, Drives]
"""The drives that train, and the drives that are scored."""


def measure(folder: Path, seeds: int) -> dict[str, Any]:
    """Run both folds with each seed; rates are pooled over all pixels, as fractions.

    Parameters
    ----------
    folder
        ``idd20k_lite`` as downloaded.
    seeds
        Number of seeds of the training, from 0.
    """
    folds = both_ways(folder)
    blind = np.concatenate([count_blind(*fold) for fold in folds])
    fewer = dict.fromkeys(("robust", UNLABELLED), SEEDS_OF_ROBUST)
    trained = {
        name: with_each_seed(config, fewer.get(name, seeds), folds) for name, config in variants()
    }
    return {
        "drives": len(blind),
        "labelled": int(blind[:, :DARK].any(axis=1).sum()),
        "blind": {"ERR": err(blind.sum(axis=0)), "dark_missed": missed(blind.sum(axis=0))},
        "variants": {name: rates_of(by_seed, blind, trained) for name, by_seed in trained.items()},
    }


def without_each_group(folder: Path) -> dict[str, Any]:
    """Return ERR of `robust`, and its change without each group of its features.

    `reach_weight` is 0; there is one seed, and `FEWER_PIXELS`. Half of the drives train, the others
    are scored.
    """
    folds = both_ways(folder)[:1]
    groups = {name: tuple(group for group in GROUPS if group != name) for name in GROUPS}
    counted = {
        name: with_each_seed(_robust_with(names), 1, folds)[0]
        for name, names in {"all": tuple(GROUPS), **groups}.items()
    }
    base = counted.pop("all")
    without = {
        name: {"dark_missed": missed(part.sum(axis=0)), **difference(err, part, base)}
        for name, part in counted.items()
    }
    return {
        "ERR": err(base.sum(axis=0)),
        "dark_missed": missed(base.sum(axis=0)),
        "without": without,
    }


def _robust_with(groups: tuple[str, ...]) -> RunConfig:
    fewer = {"max_pixels": FEWER_PIXELS}
    trees = {"features": groups, "reach_weight": 0.0}
    return configure({"preset": "robust", "trees": trees, "training": fewer})


def both_ways(folder: Path) -> tuple[Fold, Fold]:
    """Cut the drives in two halves; return each half to train with the other half to score."""
    halves: tuple[dict[str, list[Frame]], dict[str, list[Frame]]] = {}, {}
    for name, frames in read_drives(folder).items():
        halves[blake2b(name.encode()).digest()[0] % 2][name] = frames
    return halves, halves[::-1]


def with_each_seed(config: RunConfig, seeds: int, folds: Sequence[Fold]) -> list[Counted]:
    """Train a variant with each seed; return its outcomes on every drive."""
    return [np.concatenate([score(config, seed, *fold) for fold in folds]) for seed in range(seeds)]


def rates_of(
    by_seed: list[Counted], blind: Counted, trained: Mapping[str, list[Counted]]
) -> dict[str, Any]:
    """Return a variant's rates with each seed, and the first one's differences with intervals."""
    base = trained["unfiltered"]
    numbers: dict[str, Any] = {
        "ERR": [err(counted.sum(axis=0)) for counted in by_seed],
        "dark_missed": [missed(counted.sum(axis=0)) for counted in by_seed],
        "not_below_blind": [not_below(counted, blind) for counted in by_seed],
        "against_blind": difference(err, by_seed[0], blind),
    }
    if by_seed is not base:
        numbers["against_unfiltered"] = {
            **difference(err, by_seed[0], base[0]),
            "seeds": [
                err(a.sum(axis=0)) - err(b.sum(axis=0)) for a, b in zip(by_seed, base, strict=False)
            ],
        }
    return numbers


def read_drives(folder: Path) -> dict[str, list[Frame]]:
    """Read the frames of each drive."""
    return {
        drive.name: [read(path, folder) for path in sorted(drive.glob("*_image.jpg"))]
        for drive in sorted((folder / "leftImg8bit" / "train").iterdir())
    }


def read(path: Path, folder: Path) -> Frame:
    """Read a frame; label 0 is road, 255 is ignored."""
    label = path.name.replace("_image.jpg", "_label.png")
    classes = cv2.imread(str(folder / "gtFine" / "train" / path.parent.name / label), 0)
    truth = np.select([classes == 0, classes == 255], [ROAD, IGNORE], NON_ROAD).astype(np.uint8)
    image = np.ascontiguousarray(cv2.imread(str(path))[..., ::-1])
    return Frame(0, 0, 0, image, path.read_bytes(), truth=truth)


def dark_road(frame: Frame) -> NDArray[np.bool_]:
    """Return the road darker than half of the 85th percentile of the frame's road."""
    grey, road = frame.image.mean(axis=2), frame.truth == ROAD
    return road & (grey < 0.5 * np.percentile(grey[road], 85)) if road.any() else road


def counts(mask: NDArray[np.uint8], frame: Frame) -> NDArray[np.int64]:
    """Count a mask's outcomes on a frame, and on its dark road."""
    road, other, dark = frame.truth == ROAD, frame.truth == NON_ROAD, dark_road(frame)
    called = mask > 0
    sets = [road & called, other & ~called, other & called, road & ~called, dark, dark & ~called]
    return np.array([part.sum() for part in sets])


def variants() -> Iterator[tuple[str, RunConfig]]:
    """Yield the variants to compare: colours without a filter, and presets."""
    paper = configure()
    yield VARIANTS[0], replace(paper, pipeline=paper.pipeline.without_filter())
    yield "paper", paper
    yield "gated", configure({"preset": "gated", "chain": FILTER_ALONE})
    yield "robust", configure({"preset": "robust"})
    yield UNLABELLED, configure({"preset": "robust", "training": {"source": "patch"}})


def count_blind(train: Drives, test: Drives) -> Counted:
    """Count the outcomes of the mean truth of ``train``."""
    prior = BlindPrior.of_truths([frame.truth for frame in _all(train)])
    return np.array(
        [
            sum(counts(prior.mask(f.image.shape[:2]).pixels(), f) for f in frames)
            for frames in test.values()
        ]
    )


def score(config: RunConfig, seed: int, train: Drives, test: Drives) -> Counted:
    """Train a variant and count its outcomes on each drive."""
    model = fit(_all(train), {"it": config.pipeline}, replace(config.training, seed=seed))
    chain: Chain = config.pipeline.bind(model.parameters["it"])
    return np.array([sum(counts(last(chain, f), f) for f in frames) for frames in test.values()])


def last(chain: Chain, frame: Frame) -> NDArray[np.uint8]:
    """Return the chain's final mask."""
    *_, final = chain.run(View.of(frame.image))
    return final.output.mask.pixels()


def err(total: Counted) -> Any:
    """Return the pooled ERR of one drive, or of each of several."""
    return (total[..., FP] + total[..., FN]) / total[..., :DARK].sum(axis=-1)


def missed(total: Counted) -> float:
    """Return the share of dark road that is missed."""
    return total[DARK_MISSED] / total[DARK]


def not_below(rows: Counted, blind: Counted) -> int:
    """Return the number of labelled drives with an ERR that is not below that of ``blind``."""
    labelled = blind[:, :DARK].any(axis=1)
    return int((err(rows[labelled]) >= err(blind[labelled])).sum())


def difference(rate: Any, new: Counted, base: Counted) -> dict[str, float]:
    """Return a rate's difference, with its 95 % interval of a bootstrap over drives."""

    def of(a: Counted, b: Counted) -> float:
        return float(rate(a.sum(axis=0)) - rate(b.sum(axis=0)))

    draws = np.random.default_rng(0).integers(len(new), size=(DRAWS, len(new)))
    low, high = np.percentile([of(new[drawn], base[drawn]) for drawn in draws], [2.5, 97.5])
    return {"mean": of(new, base), "low": float(low), "high": float(high)}


def _all(drives: Drives) -> list[Frame]:
    return [frame for frames in drives.values() for frame in frames]
