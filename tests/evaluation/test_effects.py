"""The differences of a drive: which there are, and which are corrected together."""

import numpy as np
import pytest

from roadeval.evaluation.score import FrameCounts, drive_effects
from roadeval.evaluation.settings import EvaluationSettings

SETTINGS = EvaluationSettings()


def effects_of(masks, settings=SETTINGS):
    """The differences of a drive of one camera."""
    return drive_effects([masks], settings)


def a_mask(variant, stage, errors, positions=None):
    """A mask's frames of 100 pixels, so many of which are wrong: all of them FP."""
    wrong = np.array(errors)
    counts = np.stack([np.full(len(wrong), 50), 50 - wrong, wrong, np.zeros_like(wrong)], axis=1)
    places = np.array(range(len(wrong)) if positions is None else positions)
    return FrameCounts(variant, stage, places, places, counts)


def of(*masks):
    """What is subtracted from what: base, variant, stage, and whether both are final."""
    effects = effects_of([a_mask(*mask, [3] * 12) for mask in masks])
    return [(each.base, each.variant, each.stage, each.final) for each in effects]


def test_the_filter_is_told_stage_by_stage_and_other_variants_by_their_final_mask():
    stages = ("svm", "post")
    pair = [(variant, stage) for variant in ("filtered", "unfiltered") for stage in stages]
    assert of(*pair, ("net", "svm"), ("net", "post"), ("blind", "post")) == [
        ("unfiltered", "filtered", "svm", False),
        ("unfiltered", "filtered", "post", True),
        ("unfiltered", "net", "post", True),
        ("blind", "filtered", "post", True),
        ("blind", "unfiltered", "post", True),
        ("blind", "net", "post", True),
    ]


def test_a_difference_is_the_variant_minus_the_base_on_the_frames_that_both_have():
    pair = a_mask("filtered", "post", [10, 10, 90]), a_mask("unfiltered", "post", [7, 9], [0, 1])
    (effect,) = effects_of(pair)
    found = effect.rates["ERR"]
    assert (found.units, found.mean) == (2, pytest.approx(0.02))
    assert [*effect.rates] == ["ACC", "ERR", "FNR", "FPR"]


def test_final_masks_against_one_base_are_corrected_together():
    rng = np.random.default_rng(2)
    names = [("filtered", "svm"), ("filtered", "post"), ("unfiltered", "svm")]
    names += [("unfiltered", "post"), ("net", "post"), ("blind", "post")]
    masks = [a_mask(*name, rng.integers(5, 20, 40)) for name in names]
    effects = effects_of(masks)
    sizes = [(each.base, each.final, each.rates["ERR"].comparisons) for each in effects]
    assert sizes == [
        ("unfiltered", False, None),
        *[("unfiltered", True, 2)] * 2,
        *[("blind", True, 3)] * 3,
    ]
    assert {each.rates["FPR"].comparisons for each in effects} == {None}
