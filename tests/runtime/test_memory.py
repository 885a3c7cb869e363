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
    for _ in range(50):
        np.ones(1 << 20, np.uint8)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

first = faults()
reuse()
faults()
print(first, faults())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's malloc is set")
def test_arrays_that_were_freed_are_not_asked_of_the_system_again() -> None:
    run = subprocess.run([sys.executable, "-c", FAULTS], stdout=subprocess.PIPE, check=True)
    before, after = map(int, run.stdout.split())

    assert before > 50 * 10  # pages
    assert after < before / 10
