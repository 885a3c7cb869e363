"""By what images and labels are paired."""

import numpy as np
import pytest

from roadeval.logs.topics.reader import UNREADABLE
from roadeval.logs.truth.pairing import ALONE_NS, Clock, clock_of, tolerance

BAD = UNREADABLE
TIMES = [100, 200, 300]


class Topic:
    """The messages of a topic, of which only stamps and log times are known."""

    def __init__(self, stamps, times):
        self.stamp = stamps.__getitem__
        self.log_times = np.array(times)

    def __len__(self):
        return len(self.log_times)


@pytest.mark.parametrize(
    ("stamps", "times", "clock"),
    [
        ([1, 2, 3], TIMES, Clock.STAMP),
        ([0, 0, 0], TIMES, Clock.LOG_TIME),
        ([7, 7, 7], TIMES, Clock.LOG_TIME),
        ([0, 0, 0], [100, 100, 100], Clock.ORDER),
        ([7], [100], Clock.STAMP),
        ([0], [100], Clock.LOG_TIME),
        # Of all images but one nothing can be read: that its stamp is the only one says nothing.
        ([BAD, 7, BAD], TIMES, Clock.STAMP),
        ([*[BAD] * 20, 7, 8], list(range(22)), Clock.STAMP),
    ],
)
def test_stamps_count_unless_they_are_zero_or_equal(stamps, times, clock):
    assert clock_of(Topic(stamps, times)) is clock


@pytest.mark.parametrize(
    ("stamps", "times", "asked_ms", "found"),
    [
        ([0, 1000, 2000, 3000], TIMES, None, 50),
        # Written in one go: the log times say nothing.
        ([0, 1000, 2000, 3000], [7, 7, 7, 7], None, 500),
        ([0, BAD, 2000, BAD], [7, 7, 7, 7], None, 1000),
        ([0, 1000, 2000, 3000], TIMES, 1.5, 1_500_000),
        ([1000], [100], None, ALONE_NS),
        ([1000], [100], 1.5, 1_500_000),
    ],
)
def test_half_the_frame_period_may_lie_between_an_image_and_its_label(
    stamps, times, asked_ms, found
):
    assert tolerance(Topic(stamps, times), asked_ms) == found
