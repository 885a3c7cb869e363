"""Rates of `robust` with several weights of the distance from the patch, at home and elsewhere.

With one seed, and on IDD's own drives with fewer training pixels. What the trees have learnt is the
same in a row: the setting is one of inference.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.tables import idd
from benchmarks.tables.drives import DRIVES, Sources
from benchmarks.tables.taught import IDD_LITE, model_of, summary
from roadeval.config.run import RunConfig, configure
from roadeval.data import FINAL_STAGE
from roadeval.training.learning import fit

WEIGHTS: Final = (0.0, 0.5, 1.0, 2.0, 4.0)
"""Of `TreesSettings.reach_weight`."""
OWN: Final = "own"
"""In the place of a teacher: the drive's own first frames."""
HALF: Final = "half"
"""Likewise: one half of IDD's drives, where the other is scored."""
PAIRS: Final = (
    (OWN, "camvid_0016E5_15hz"),
    (OWN, "camvid_0006R0_1hz"),
    (OWN, "synthetic_0"),
    (IDD_LITE, "camvid_0016E5_15hz"),
    (IDD_LITE, "camvid_0006R0_1hz"),
    ("camvid_0006R0_1hz", "camvid_0016E5_15hz"),
    ("camvid_0006R0_1hz", "synthetic_0"),
)
"""Who teaches, and which drive is scored."""


def measured(sources: Sources, idd_lite: Path) -> list[dict[str, Any]]:
    """Return ERR with each of `WEIGHTS`, on IDD's other half dark road missed besides."""
    rows = [{"teacher": HALF, "pupil": IDD_LITE, **_on_idd(idd_lite)}]
    for teacher, pupil in PAIRS:
        own = teacher == OWN
        training = {} if own else {"model": str(model_of(teacher, 0, sources, idd_lite))}
        each = [{"training": training, "trees": {"reach_weight": weight}} for weight in WEIGHTS]
        found = [summary(DRIVES[pupil], tables, sources) for tables in each]
        (variant,) = found[0]["against_blind"]
        rates = [one["totals"][variant][FINAL_STAGE]["ERR"] for one in found]
        rows.append({"teacher": teacher, "pupil": pupil, "ERR": rates})
    return rows


def _on_idd(folder: Path) -> dict[str, list[float]]:
    """Return rates with each weight on one half of IDD's drives, of trees that the other taught."""
    train, test = idd.both_ways(folder)[0]
    config = _robust(WEIGHTS[0])
    frames = [frame for drive in train.values() for frame in drive]
    learnt = fit(frames, {"it": config.pipeline}, config.training).parameters["it"]
    chains = [_robust(weight).pipeline.bind(learnt) for weight in WEIGHTS]
    counted = [
        np.sum([idd.counts(idd.last(chain, f), f) for each in test.values() for f in each], axis=0)
        for chain in chains
    ]
    return {
        "ERR": [float(idd.err(each)) for each in counted],
        "dark_missed": [float(idd.missed(each)) for each in counted],
    }


def _robust(weight: float) -> RunConfig:
    fewer = {"training": {"max_pixels": idd.FEWER_PIXELS}}
    return configure({"preset": "robust", "trees": {"reach_weight": weight}, **fewer})
