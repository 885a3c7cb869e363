"""How much worse disturbed frames are: paired, by camera, and corrected for their number."""

import numpy as np
import pandas as pd
import pytest

from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.score.degradation import degradations
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import rates_of

SETTINGS = EvaluationSettings()


def a_table(camera: str, wrong: list[int], **columns: str) -> pd.DataFrame:
    """Rows of the variant ``net`` on frames of 1000 pixels, of which so many are wrong."""
    frames = np.arange(len(wrong))
    table = pd.DataFrame({"frame": frames, "stamp_ns": frames * 100_000_000, "FP": wrong})
    table = table.assign(TP=500, TN=500 - table["FP"], FN=0)
    table = table.assign(drive="d", camera=camera, variant="net", stage="post", **columns)
    return table.join(rates_of(table, METRICS))


def test_a_change_is_that_of_the_same_frames_and_the_mean_of_cameras_means():
    wrong = {"front": [10, 20, 30, 40], "rear": [50, 60]}
    frames = pd.concat([a_table(camera, errors) for camera, errors in wrong.items()])
    # The first frame of the front camera failed under the disturbance.
    disturbed = pd.concat(
        [
            a_table("front", [10, 120, 130, 140], disturbance="fog:2")[1:],
            a_table("rear", [70, 80], disturbance="fog:2"),
        ]
    )
    change = degradations(disturbed, frames, SETTINGS)["net"]["fog-2"]
    assert (change.kind, change.strength, change.text) == ("fog", 2, "fog:2")
    assert change.base_ERR == pytest.approx((30 + 55) / 2 / 1000)
    error = change.ERR
    assert error == pytest.approx((130 + 75) / 2 / 1000)
    assert change.difference.mean == pytest.approx(error - change.base_ERR)
    assert (change.difference.units, change.difference.worse) == (5, 5)


def test_changes_are_corrected_for_all_that_are_told_together():
    random = np.random.default_rng(0)
    wrong = random.integers(10, 60, 40)
    frames = a_table("front", [*wrong])
    disturbed = pd.concat(
        a_table("front", [*(wrong + random.integers(0, most, 40))], disturbance=f"fog:{most}")
        for most in (2, 4, 8)
    )
    changes = degradations(disturbed, frames, SETTINGS)["net"].values()
    assert [change.difference.comparisons for change in changes] == [3] * 3
    assert all(change.difference.p_holm >= change.difference.p for change in changes)
