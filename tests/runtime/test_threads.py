"""An ordered, bounded map over threads that stops at the first error; memory that is kept."""

import subprocess
import sys
import threading
import time

import pytest

from roadeval.runtime.threads import AHEAD, map_ordered, time_limit


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_results_come_in_the_order_of_the_items(jobs):
    def work(item: int) -> int:
        time.sleep(0.002 * (item % 3))  # later items are often done earlier
        return item * item

    assert list(map_ordered(work, range(30), jobs)) == [n * n for n in range(30)]


def test_items_are_drawn_only_as_results_are_taken():
    drawn = []

    def items():
        for number in range(1000):
            drawn.append(number)
            yield number

    results = map_ordered(lambda n: n, items(), jobs=2)
    for taken in range(1, 20):
        next(results)
        assert len(drawn) <= taken + 2 + AHEAD
    results.close()


def test_an_error_in_the_work_stands_in_its_items_place():
    def work(item: int) -> int:
        if item == 3:
            raise ValueError("frame 3")
        return item

    results = map_ordered(work, range(10), jobs=2)
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="frame 3"):
        next(results)


def test_no_thread_outlives_a_caller_that_stops_early():
    results = map_ordered(lambda n: n, range(1000), jobs=3)
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

    results = map_ordered(work, range(3), 2)
    assert next(results) == 0
    results.close()
    assert endless.is_set()


FAULTS = """
import resource
import numpy as np
from roadeval.runtime.memory import reuse

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        [np.ones(1 << 20, np.uint8) for _ in range(20)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

faults()
first = faults()
reuse()
faults()
print(first, faults())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's malloc is set")
def test_arrays_that_were_freed_are_not_asked_of_the_system_again() -> None:
    run = subprocess.run([sys.executable, "-c", FAULTS], stdout=subprocess.PIPE, check=True)
    before, after = map(int, run.stdout.split())

    assert before > 20 * 20  # pages
    assert after < before / 10
