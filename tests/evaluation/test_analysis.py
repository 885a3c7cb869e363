"""What a report makes of the tables."""

import math

import pandas as pd
import pytest

from roadeval.evaluation import score
from roadeval.results.schema import TABLES
from tests.evaluation.making import a_table, rows_of

POST, CONTROL_POST = ("filtered", "post"), ("unfiltered", "post")


def test_pairs_subtract_the_same_frames_only():
    frames = a_table({POST: [10, 20, 30], CONTROL_POST: [10, 25]})
    paired = score.pairs(rows_of(frames), "filtered", "unfiltered")
    assert paired["frame"].tolist() == [0, 1]
    assert paired["ERR"].tolist() == pytest.approx([0, -0.05])
    assert paired["wrong"].tolist() == [0, -5]


def test_a_region_tells_its_share_of_the_pixels_and_of_the_errors():
    regions = pd.DataFrame(
        [
            (0, "filtered", "post", "boundary", 5, 0, 5, 0, 10),
            (0, "filtered", "post", "interior", 40, 45, 5, 0, 90),
            (0, "filtered", "post", "shadow", 0, 0, 0, 0, 0),
        ],
        columns=list(TABLES["regions"].names[2:]),
    )
    found = score.by_region(rows_of(regions))
    assert [*found] == [(name, "filtered") for name in ("boundary", "interior", "shadow")]
    boundary, _, shadow = found.values()
    assert boundary["ERR"] == 0.5
    assert [each["pixels"] for each in found.values()] == pytest.approx([0.1, 0.9, 0.0])
    assert [each["errors"] for each in found.values()] == pytest.approx([0.5, 0.5, 0.0])
    assert math.isnan(shadow["ERR"])


def test_a_perfect_stage_is_judged_on_the_frames_that_have_both_masks():
    frames = a_table({("filtered", "svm"): [40, 40, 40], POST: [10, 20, 30]})
    oracles = a_table({("filtered", "svm"): [0, 0], POST: [4, 6]}).assign(oracle="svm")
    rows = rows_of(oracles).replace(oracle=rows_of(oracles)["oracle"].astype(str))
    (found,) = score.perfect_stages(rows, rows_of(frames))
    assert (found["variant"], found["oracle"], found["frames"]) == ("filtered", "svm", 2)
    assert (found["ERR"], found["as_is"]) == pytest.approx((0.05, 0.15))
    assert list(score.perfect_stages(rows.take(slice(0)), rows_of(frames))) == []


@pytest.mark.parametrize(
    ("chains", "order"),
    [
        ([("svm", "post"), ("trees", "post")], ["svm", "trees", "post"]),
        ([("net", "post"), ("svm", "post", "smooth")], ["net", "svm", "post", "smooth"]),
        ([("svm",), ("net",)], ["svm", "net"]),
        ([("a", "b"), ("b", "a")], ["a", "b"]),
        ([], []),
    ],
)
def test_stages_of_several_chains_stand_in_the_order_of_each(chains, order):
    assert score.merged(chains) == order
