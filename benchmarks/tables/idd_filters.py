"""The effects of the shadow filters on drives that nothing was trained on.

A filter is judged by ERR and by dark road missed together, and by its effect on frames without
dark road.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.tables import idd
from roadeval.config.run import RunConfig, configure
from roadeval.pipeline.chain import Chain
from roadeval.training.learning import fit

SEEDS: Final = 3
FLAT: Final = 0.03
"""A frame is flat if less than this share of its road is dark."""
ODDS: Final = (0.1, 1.0)
"""Factors of the odds, see `roadeval.pipeline.beyond.gated.GatedSettings`."""
CHAINS: Final[Mapping[str, Mapping[str, Any]]] = {
    "colours": {"preset": "gated", "chain": idd.FILTER_ALONE},
    "robust": {
        "preset": "robust",
        "chain": ("gated", "exposure", "trees", "post"),
        "training": {"max_pixels": idd.FEWER_PIXELS},
    },
}
"""The filter before a classifier on colours, and before all that `robust` looks at."""
Frames = NDArray[np.int64]
"""Outcomes on each frame, ``(drives, n, 6)``: n is the most frames that one of them has, and zeros
stand for a frame that a drive does not have."""


def measure(folder: Path) -> dict[str, Any]:
    """Measure the filter with each factor of its odds before each classifier.

    Rates are pooled over pixels, as fractions; differences are of the filtered and the unfiltered
    chain of the same seed.
    """
    folds = idd.both_ways(folder)
    results: dict[str, Any] = {"seeds": SEEDS}
    for name, tables in CHAINS.items():
        base = [_outcomes(_unfiltered(tables), seed, folds) for seed in range(SEEDS)]
        flat = _flat(base[0])
        rates = [_rates(frames, flat) for frames in base]
        results[name] = {"none": {key: [seed[key] for seed in rates] for key in rates[0]}}
        for odds in ODDS:
            config = configure({**tables, "gated": {"odds": odds}})
            new = [_outcomes(config, seed, folds) for seed in range(SEEDS)]
            results[name][f"{odds:g}"] = [
                _changes(a, b, flat) for a, b in zip(new, base, strict=True)
            ]
        results["flat_frames"] = int(flat.sum())
    return results


def _unfiltered(tables: Mapping[str, Any]) -> RunConfig:
    config = configure(dict(tables))
    return replace(config, pipeline=config.pipeline.without_filter())


def _outcomes(config: RunConfig, seed: int, folds: Sequence[idd.Fold]) -> Frames:
    most = max(len(frames) for _, test in folds for frames in test.values())
    return np.concatenate([_by_frame(config, seed, most, *fold) for fold in folds])


def _by_frame(
    config: RunConfig, seed: int, most: int, train: idd.Drives, test: idd.Drives
) -> Frames:
    frames = [frame for drive in train.values() for frame in drive]
    model = fit(frames, {"it": config.pipeline}, replace(config.training, seed=seed))
    chain: Chain = config.pipeline.bind(model.parameters["it"])
    rows = np.zeros((len(test), most, 6), np.int64)
    for drive, row in zip(test.values(), rows, strict=True):
        for index, frame in enumerate(drive):
            row[index] = idd.counts(idd.last(chain, frame), frame)
    return rows


def _flat(frames: Frames) -> NDArray[np.bool_]:
    """Return which frames have road and next to no dark road."""
    road = frames[..., idd.TP] + frames[..., idd.FN]
    return (road > 0) & (frames[..., idd.DARK] < FLAT * road)


def _parts(frames: Frames, flat: NDArray[np.bool_]) -> tuple[idd.Counted, idd.Counted]:
    """Return the outcomes by drive, of all frames and of flat ones."""
    return frames.sum(axis=1), (frames * flat[..., None]).sum(axis=1)


def _rates(frames: Frames, flat: NDArray[np.bool_]) -> dict[str, float]:
    every, some = (part.sum(axis=0) for part in _parts(frames, flat))
    return {"ERR": idd.err(every), "dark_missed": idd.missed(every), "flat_ERR": idd.err(some)}


def _changes(new: Frames, base: Frames, flat: NDArray[np.bool_]) -> dict[str, Any]:
    pairs = list(zip(_parts(new, flat), _parts(base, flat), strict=True))
    drives = flat.any(axis=1)
    return {
        **_rates(new, flat),
        "change": idd.difference(idd.err, *pairs[0]),
        "dark_change": idd.difference(idd.missed, *pairs[0]),
        "flat_change": idd.difference(idd.err, *(part[drives] for part in pairs[1])),
    }
