"""The sentence at the top of the results."""

import pytest

from roadeval.evaluation.uncertainty import Difference
from roadeval.results.verdict import NO_PAIR, NOTHING_SCORED, verdict, verdict_of


def difference(mean: float, low: float | None, high: float | None) -> Difference:
    reason = "91 frames are worth about 5 independent ones" if low is None else None
    return Difference(mean, low, high, 0.95, None, 91, 5.0, 3.0, reason)


@pytest.mark.parametrize(
    ("found", "sentence"),
    [
        (
            difference(0.092, 0.071, 0.11),
            "On this drive the filter raises ERR of post by 9.2 pp [7.1, 11.0].",
        ),
        (
            difference(-0.014, -0.024, -0.008),
            "On this drive the filter lowers ERR of post by 1.4 pp [0.8, 2.4].",
        ),
        (
            difference(0.003, -0.004, 0.01),
            "On this drive the filter has no clear effect on ERR of post: +0.3 pp [-0.4, +1.0].",
        ),
        (
            difference(0.092, None, None),
            "Cannot tell whether the filter helps on this drive: ERR of post rose by 9.2 pp "
            "on average, but 91 frames are worth about 5 independent ones.",
        ),
        (
            difference(-0.092, None, None),
            "Cannot tell whether the filter helps on this drive: ERR of post fell by 9.2 pp "
            "on average, but 91 frames are worth about 5 independent ones.",
        ),
        (
            difference(0.0, None, None),
            "Cannot tell whether the filter helps on this drive: ERR of post did not change "
            "on average, but 91 frames are worth about 5 independent ones.",
        ),
        (
            difference(0.0, 0.0, 0.0),
            "On this drive the filter leaves ERR of post of every frame as it is.",
        ),
    ],
)
def test_the_verdict_says_what_the_interval_allows(found: Difference, sentence: str) -> None:
    assert verdict(found, "ERR", "post") == sentence


def test_where_no_frame_has_a_difference_there_is_no_verdict() -> None:
    nothing = Difference(float("nan"), None, None, 0.95, None, 0, None, None, "there are 0 frames")
    sentence = "Nothing to compare: ERR of post is undefined on every frame."
    assert verdict(nothing, "ERR", "post") == sentence


def test_without_a_score_or_a_pair_the_verdict_says_so() -> None:
    found = {"post": {"ERR": difference(0.092, 0.071, 0.11)}}
    assert verdict_of({}, {}) == NOTHING_SCORED
    assert verdict_of({"unfiltered": {}}, {}) == NO_PAIR
    assert verdict_of({"filtered": {}, "unfiltered": {}}, found).startswith("On this drive the")
