"""Slices over drives: tags, and times of the drive and of the day, are conditions, too."""

import numpy as np
import pandas as pd
import pytest

from benchmarks.slices import make_fleet
from roadeval.evaluation.stats.slices import FrameCondition
from roadeval.results.over_drives import slices_over_drives


@pytest.mark.parametrize(("drives", "named"), [(40, True), (0, False)])
def test_a_tag_of_a_drive_is_a_condition_and_a_fleet_without_drives_has_none(drives, named):
    real = pd.DataFrame({"brightness": np.linspace(0, 1, 60)})
    frames, conditions, parts = make_fleet(np.random.default_rng(6), [real], 40)
    names, weathers = zip(*conditions.groupby("drive")["tag_weather"].first().items(), strict=True)
    table = pd.DataFrame({"drive": names, "evaluated": 60, "tag_weather": weathers})[:drives]
    frames.loc[(conditions["tag_weather"] == "rain").to_numpy(), "FP"] *= 4
    tables = {
        "conditions": conditions.drop(columns=["group", "tag_weather"]),
        "frames": frames.assign(variant="net", stage="post", final=True),
        "regions": parts.rename(columns={"wrong": "FP"}).assign(FN=0, variant="net"),
    }
    slices = slices_over_drives(
        lambda name, _: tables[name], table, dict(zip(names, names, strict=True)), 0.95
    )
    conditions_named = [s.conditions for s in slices.get("net", [])]
    assert ([FrameCondition("tag_weather", "is", "rain")] in conditions_named) == named
