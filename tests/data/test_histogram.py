"""The threshold that errs least, against trying each."""

import numpy as np
import pytest

from roadeval.data import CODES, IGNORE, best_code, histogram, wrong_above


def pixels(seed, levels):
    rng = np.random.default_rng(seed)
    truth = rng.choice([0, 1, IGNORE], (20, 30)).astype(np.uint8)
    codes = rng.integers(0, levels, truth.shape) * ((CODES - 1) // levels) + 9000 * (truth == 1)
    return np.minimum(codes, CODES - 1).astype(np.uint16), truth


@pytest.mark.parametrize("levels", [3, 255, 60000])
def test_no_other_threshold_errs_less(levels):
    codes, truth = pixels(levels, levels)
    known = truth != IGNORE
    counts = histogram(codes, truth)
    every = [((codes > code) != (truth == 1))[known].sum() for code in range(0, CODES, 97)]
    assert wrong_above(counts)[::97].tolist() == every
    best = best_code(counts)
    assert ((codes > best) != (truth == 1))[known].sum() <= min(every)


def test_of_thresholds_that_err_alike_it_is_the_middle_one():
    counts = np.zeros((2, CODES), np.uint32)
    counts[0, 1000], counts[1, 3001] = 5, 5
    assert best_code(counts) == 2000
    assert best_code(np.zeros_like(counts)) == (CODES - 1) // 2
