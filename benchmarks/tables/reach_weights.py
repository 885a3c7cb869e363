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
"""Values of `TreesSettings.reach_weight`."""
OWN: Final = "own"
"""Name of a drive's own first frames as its teacher."""
HALF: Final = "half"
"""Name of one half of IDD's drives as the teacher of the other half."""
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


def measure(sources: Sources, idd_lite: Path) -> list[dict[str, Any]]:
    """Return ERR with each of `WEIGHTS`, and on IDD's other half also the missed dark road."""
    rows = [{"teacher": HALF, "pupil": IDD_LITE, **_on_idd(idd_lite)}]
    for teacher, pupil in PAIRS:
        training = {} if teacher == OWN else {"model": str(model_of(teacher, 0, sources, idd_lite))}
        runs = [{"training": training, "trees": {"reach_weight": weight}} for weight in WEIGHTS]
        summaries = [summary(DRIVES[pupil], tables, sources) for tables in runs]
        (variant,) = summaries[0]["against_blind"]
        rates = [one["totals"][variant][FINAL_STAGE]["ERR"] for one in summaries]
        rows.append({"teacher": teacher, "pupil": pupil, "ERR": rates})
    return rows


def _on_idd(folder: Path) -> dict[str, list[float]]:
    """Return rates with each weight on a half of IDD's drives, by trees of the other half."""
    train, test = idd.both_ways(folder)[0]
    config = _robust(WEIGHTS[0])
    frames = [frame for drive in train.values() for frame in drive]
    learnt = fit(frames, {"it": config.pipeline}, config.training).parameters["it"]
    chains = [_robust(weight).pipeline.bind(learnt) for weight in WEIGHTS]
    counted = [
        np.sum(
            [idd.counts(idd.last(chain, f), f) for drive in test.values() for f in drive], axis=0
        )
        for chain in chains
    ]
    return {
        "ERR": [float(idd.err(total)) for total in counted],
        "dark_missed": [float(idd.missed(total)) for total in counted],
    }


def _robust(weight: float) -> RunConfig:
    fewer = {"training": {"max_pixels": idd.FEWER_PIXELS}}
    return configure({"preset": "robust", "trees": {"reach_weight": weight}, **fewer})
