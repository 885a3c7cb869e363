"""What the tables say when they are read again."""

import pandas as pd
import pytest

from roadeval.evaluation import analysis
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.schema import TABLES
from tests.evaluation.making import a_table

POST, SVM = ("filtered", "post"), ("filtered", "svm")
CONTROL_POST, CONTROL_SVM = ("unfiltered", "post"), ("unfiltered", "svm")


def test_the_final_stage_is_post_or_else_the_last():
    frames = a_table({SVM: [1], POST: [1], ("mine", "net"): [1], ("mine", "crf"): [1]})
    assert analysis.final_stages(frames) == {"filtered": "post", "mine": "crf"}


def test_pairs_subtract_the_same_frames_only():
    frames = a_table({POST: [10, 20, 30], CONTROL_POST: [10, 25]})
    paired = analysis.pairs(frames, "filtered", "unfiltered")
    assert paired.index.tolist() == [0, 1]
    assert paired["ERR"].tolist() == pytest.approx([0, -0.05])
    assert paired["wrong"].tolist() == [0, -5]


def test_frames_that_changed_most_are_those_that_changed_at_all():
    frames = a_table({POST: [10, 30, 10], CONTROL_POST: [10, 10, 15]}, hertz=1)
    paired = analysis.pairs(frames, "filtered", "unfiltered")
    assert analysis.most_changed(paired, 5, harmed=True)["frame"].tolist() == [1]
    assert analysis.most_changed(paired, 5, harmed=False)["frame"].tolist() == [2]


def test_a_region_tells_its_share_of_the_pixels_and_of_the_errors():
    regions = pd.DataFrame(
        [
            (0, "filtered", "post", "boundary", 5, 0, 5, 0, 10),
            (0, "filtered", "post", "interior", 40, 45, 5, 0, 90),
            (0, "filtered", "post", "shadow", 0, 0, 0, 0, 0),
        ],
        columns=list(TABLES["regions"].names),
    )
    found = analysis.by_region(regions).set_index("region")
    assert found.loc["boundary", "ERR"] == 0.5
    assert found["pixels"].tolist() == pytest.approx([0.1, 0.9, 0.0])
    assert found["errors"].tolist() == pytest.approx([0.5, 0.5, 0.0])
    assert pd.isna(found.loc["shadow", "ERR"])


def test_settings_of_another_version_are_read_as_far_as_they_are_known():
    evaluation = {"evaluation": {"window": 7, "from_the_future": 1}}
    assert analysis.settings_of({"run": evaluation}) == EvaluationSettings(window=7)
    assert analysis.settings_of({}) == EvaluationSettings()
