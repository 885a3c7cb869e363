"""What a report makes of the tables."""

import pandas as pd
import pytest

from roadeval.evaluation import score
from roadeval.results.schema import TABLES
from tests.evaluation.making import a_table

POST, CONTROL_POST = ("filtered", "post"), ("unfiltered", "post")


def test_pairs_subtract_the_same_frames_only():
    frames = a_table({POST: [10, 20, 30], CONTROL_POST: [10, 25]})
    paired = score.pairs(frames, "filtered", "unfiltered")
    assert paired.index.tolist() == [0, 1]
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
    found = score.by_region(regions).set_index("region")
    assert found.loc["boundary", "ERR"] == 0.5
    assert found["pixels"].tolist() == pytest.approx([0.1, 0.9, 0.0])
    assert found["errors"].tolist() == pytest.approx([0.5, 0.5, 0.0])
    assert pd.isna(found.loc["shadow", "ERR"])


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
