"""Tests of memory that is kept between frames."""

import subprocess
import sys

import pytest

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
