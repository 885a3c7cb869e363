"""Functions of every number of an array."""

import numpy as np

from roadeval.data.arrays import sigmoid


def test_a_probability_is_the_logistic_function_of_its_log_odds_and_does_not_overflow():
    odds = np.array([-1000, -2, 0, 2, 1000], np.float32)
    expected = [0, 1 / (1 + np.exp(2)), 0.5, 1 / (1 + np.exp(-2)), 1]
    np.testing.assert_allclose(sigmoid(odds), expected, atol=1e-6)
