"""The differences of a drive: which there are, and which are corrected together."""

import numpy as np
import pytest

from roadeval.evaluation.score.scoreboard import drive_effects
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import joined
from tests.evaluation.making import a_table, table_of

SETTINGS = EvaluationSettings()


def effects_of(errors):
    """The differences of a drive of one camera."""
    return drive_effects(a_table(errors), SETTINGS)


def of(*masks):
    """What is subtracted from what: base, variant, stage, and whether both are final."""
    effects = effects_of(dict.fromkeys(masks, [3] * 12))
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


def test_final_masks_of_different_stages_are_subtracted():
    assert of(("unfiltered", "svm"), ("filtered", "svm"), ("filtered", "smooth")) == [
        ("unfiltered", "filtered", "svm", False),
        ("unfiltered", "filtered", "smooth", True),
    ]


def test_what_was_tuned_is_held_against_its_method():
    assert of(("net", "post"), ("net_tuned", "post"), ("other", "post")) == [
        ("net", "net_tuned", "post", True)
    ]


def test_a_difference_is_the_variant_minus_the_base_on_the_frames_that_both_have():
    pair = {("filtered", "post"): [10, 10, 90], ("unfiltered", "post"): [7, 9]}
    (effect,) = effects_of(pair)
    found = effect.rates["ERR"]
    assert (found.units, found.mean) == (2, pytest.approx(0.02))
    assert [*effect.rates] == ["ACC", "ERR", "FNR", "FPR"]


def test_each_camera_counts_the_same_in_a_difference():
    front = {("filtered", "post"): [12] * 30, ("unfiltered", "post"): [10] * 30}
    rear = {("filtered", "post"): [14] * 10, ("unfiltered", "post"): [10] * 10}
    rig = joined([a_table(front), a_table(rear, camera="/rear")])
    (effect,) = drive_effects(rig, SETTINGS)
    assert (effect.rates["ERR"].units, effect.rates["ERR"].mean) == (40, pytest.approx(0.03))


def test_a_drive_without_frames_has_no_difference():
    assert drive_effects(table_of("frames", []), SETTINGS) == []


def test_final_masks_against_one_base_are_corrected_together():
    rng = np.random.default_rng(2)
    names = [("filtered", "svm"), ("filtered", "post"), ("unfiltered", "svm")]
    names += [("unfiltered", "post"), ("net", "post"), ("blind", "post")]
    effects = effects_of({name: rng.integers(5, 20, 40).tolist() for name in names})
    sizes = [(each.base, each.final, each.rates["ERR"].comparisons) for each in effects]
    assert sizes == [
        ("unfiltered", False, None),
        *[("unfiltered", True, 2)] * 2,
        *[("blind", True, 3)] * 3,
    ]
    assert {each.rates["FPR"].comparisons for each in effects} == {None}
