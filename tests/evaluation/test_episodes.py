"""Error episodes: how long a mask errs, and when it recovers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roadeval.evaluation.score.scoreboard import episodes

SECOND = 10**9


def found(seconds, errors, limit=0.15):
    stamps = np.array([round(SECOND * each) for each in seconds], np.int64)
    return episodes(stamps, np.array(errors, float), limit)


def test_an_episode_lasts_from_its_first_frame_to_the_first_one_below_the_limit():
    assert found([0, 0.5, 1, 1.5, 2, 2.5], [0.1, 0.15, 0.3, 0.14, 0.2, 0.0]) == {
        "limit": 0.15,
        "episodes": 2,
        "recovered": 2,
        "seconds": 1.5,
        "share": 1.5 / 2.5,
        "longest": 1.0,
        "recovery": 0.75,
    }


def test_a_frame_whose_rate_is_undefined_says_nothing():
    own = found([0, 1, 2, 3], [0.2, math.nan, 0.2, 0])
    assert (own["episodes"], own["seconds"]) == (1, 3.0)
    none = found([0, 1], [math.nan, math.nan])
    assert (none["episodes"], none["seconds"], none["recovery"]) == (0, 0, None)
    assert math.isnan(none["share"])
    assert str(none) == str(found([], []))


def test_stamps_out_of_order_are_put_in_order():
    assert found([2, 0, 1], [0, 0.2, 0.2]) == found([0, 1, 2], [0.2, 0.2, 0])


@given(st.lists(st.tuples(st.sampled_from([1, 2, 9, 20]), st.booleans()), max_size=30))
def test_equals_a_search_from_each_first_frame(frames):
    """Every frame that begins an episode, and from there to the first that ends it."""
    stamps = np.cumsum([step for step, _ in frames] or [0]) * SECOND // 2
    bad = [is_bad for _, is_bad in frames] or [False]
    steps = np.diff(stamps)
    gap = max(SECOND, 3 * np.median(steps)) if len(steps) else 0
    times, recovered = [], []
    for first in range(len(bad)):
        follows = first > 0 and bad[first - 1] and steps[first - 1] <= gap
        if not bad[first] or follows:
            continue
        last = first
        while last + 1 < len(bad) and steps[last] <= gap and bad[last]:
            last += 1
        times.append(stamps[last] - stamps[first])
        if not bad[last]:
            recovered.append(times[-1])
    own = episodes(stamps, np.where(bad, 0.5, 0.0), 0.15)
    assert (own["episodes"], own["recovered"]) == (len(times), len(recovered))
    assert own["seconds"] == pytest.approx(sum(times) / SECOND)
    if known := sum(steps[steps <= gap]):
        assert own["share"] == pytest.approx(sum(times) / known)
    assert own["longest"] == max(times, default=0) / SECOND
    assert own["recovery"] == (np.median(recovered) / SECOND if recovered else None)
