"""An ordered, bounded map over threads that stops at the first error."""

import threading
import time

import pytest

from roadeval.runtime.threads import AHEAD, ordered, time_limit


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_results_come_in_the_order_of_the_items(jobs):
    def work(item: int) -> int:
        time.sleep(0.002 * (item % 3))  # later items are often done earlier
        return item * item

    assert list(ordered(work, range(30), jobs)) == [n * n for n in range(30)]


def test_items_are_drawn_only_as_results_are_taken():
    drawn = []

    def items():
        for number in range(1000):
            drawn.append(number)
            yield number

    results = ordered(lambda n: n, items(), jobs=2)
    for taken in range(1, 20):
        next(results)
        assert len(drawn) <= taken + 2 + AHEAD
    results.close()


def test_an_error_in_the_work_stands_in_its_items_place():
    def work(item: int) -> int:
        if item == 3:
            raise ValueError("frame 3")
        return item

    results = ordered(work, range(10), jobs=2)
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="frame 3"):
        next(results)


def test_no_thread_outlives_a_caller_that_stops_early():
    results = ordered(lambda n: n, range(1000), jobs=3)
    next(results)
    results.close()
    assert not [t for t in threading.enumerate() if t.name.startswith("roadeval")]


def test_work_without_end_is_ended_where_the_map_is_stopped_early():
    endless = threading.Event()

    def work(item: int) -> int:
        if item:
            with time_limit(endless.set, 600):
                endless.wait()
        return item

    results = ordered(work, range(3), 2)
    assert next(results) == 0
    results.close()
    assert endless.is_set()
