"""Corrections of p-values for how many there are."""

import numpy as np
import pytest
from statsmodels.stats.multitest import multipletests

from roadeval.evaluation.stats.corrections import benjamini_hochberg, holm_p_values

VALUES = [0.03, 0.001, 0.2, 0.04, 0.011, 0.04, 0.9]


@pytest.mark.parametrize(
    ("correct", "name"), [(holm_p_values, "holm"), (benjamini_hochberg, "fdr_bh")]
)
def test_a_correction_is_that_of_statsmodels(correct, name: str) -> None:
    expected = multipletests(VALUES, method=name)[1].tolist()
    assert correct(VALUES) == pytest.approx(expected)


@pytest.mark.parametrize("correct", [holm_p_values, benjamini_hochberg])
def test_what_was_not_tested_is_not_counted_and_stays_so(correct) -> None:
    tested = correct([0.01, 0.02])
    assert correct([0.01, None, 0.02, None]) == [tested[0], None, tested[1], None]
    assert correct([None]) == [None]
    assert correct([]) == []


@pytest.mark.parametrize("correct", [holm_p_values, benjamini_hochberg])
def test_no_corrected_value_is_above_1_or_below_what_it_was(correct) -> None:
    values = np.random.default_rng(1).uniform(size=50).tolist()
    assert all(p <= corrected <= 1 for p, corrected in zip(values, correct(values), strict=True))


def test_of_drives_that_seem_to_differ_about_as_few_as_asked_for_do_not() -> None:
    rng, false = np.random.default_rng(2), []
    for _ in range(200):
        # Half of 40 drives differ, so that half of the tenth that is allowed is false.
        values = [*rng.uniform(size=20), *(rng.uniform(size=20) / 500)]
        found = np.array(benjamini_hochberg(values)) <= 0.1
        false.append(found[:20].sum() / max(found.sum(), 1))
    assert np.mean(false) == pytest.approx(0.05, abs=0.015)
