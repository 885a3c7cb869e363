"""Parts of a fleet by tag and by condition."""

import math

import numpy as np
import pytest
from statsmodels.stats.multitest import multipletests

from roadeval.evaluation.drives import AcrossSettings, across_drives, strata
from tests.evaluation.drives.making import drives

SETTINGS = AcrossSettings()
FLEET = drives(np.random.default_rng(3).normal(0.01, 0.02, 24).tolist())
LIGHT = ["dusk", "day", "night"] * 8
LUMINANCE = [float(place) for place in range(24)]


def parts(tags=None, conditions=None, fleet=FLEET) -> list:
    return strata(fleet, tags or {}, conditions or {}, SETTINGS)


def test_each_value_of_a_tag_is_summed_up_by_itself() -> None:
    found = parts({"light": LIGHT})
    assert [(each.by, each.value, each.least) for each in found] == [
        ("light", "day", None),
        ("light", "dusk", None),
        ("light", "night", None),
    ]
    assert [each.across for each in found] == [
        across_drives(FLEET[start::3], SETTINGS) for start in (1, 0, 2)
    ]


def test_a_condition_is_cut_at_the_fleet_s_thirds() -> None:
    found = parts(None, {"luminance": LUMINANCE[::-1]})
    assert [(each.value, each.least, each.most) for each in found] == [
        ("low", 0.0, 7.0),
        ("middle", 8.0, 15.0),
        ("high", 16.0, 23.0),
    ]
    assert [each.across for each in found] == [
        across_drives(FLEET[start : start + 8], SETTINGS) for start in (16, 8, 0)
    ]


def test_drives_of_one_value_stay_together() -> None:
    found = parts(None, {"luminance": [1.0] * 20 + [2.0] * 4})
    assert [(each.value, each.across.drives) for each in found] == [("low", 20), ("high", 4)]


def test_a_drive_without_a_value_is_left_out_of_that_division_alone() -> None:
    found = parts({"light": [None, *LIGHT[1:]]}, {"luminance": [*LUMINANCE[:22], None, math.nan]})
    drives_in = {
        name: sum(each.across.drives for each in found if each.by == name)
        for name in ("light", "luminance")
    }
    assert drives_in == {"light": 23, "luminance": 22}


def test_what_does_not_divide_the_drives_makes_no_parts() -> None:
    assert parts({"light": ["day"] * 24}, {"luminance": [3.0] * 24}) == []
    assert parts({"light": [None] * 24}, {"luminance": [None] * 24}) == []
    assert [each.value for each in parts({"light": ["day"] * 23 + [None]})] == ["day"]
    assert parts({"light": []}, {"luminance": []}, fleet=[]) == []


def test_a_drive_without_a_mean_counts_nowhere() -> None:
    fleet = [*FLEET, *drives([math.nan])]
    found = strata(fleet, {"light": [*LIGHT, "fog"]}, {"sun": [*LUMINANCE, 1000.0]}, SETTINGS)
    assert "fog" not in [each.value for each in found]
    assert found[-1].most == 23.0


def test_p_values_are_corrected_for_all_parts_together() -> None:
    found = parts({"light": LIGHT}, {"luminance": LUMINANCE})
    expected = multipletests([each.across.p for each in found], method="holm")[1]
    assert [each.p_holm for each in found] == pytest.approx(expected.tolist())
    assert {each.comparisons for each in found} == {6}


def test_parts_in_which_nothing_can_be_found_are_not_counted() -> None:
    weather = ["fog"] * 2 + ["rain"] * 10 + ["sun"] * 12
    fleet = FLEET[:12] + drives([0.0] * 12)
    fog, rain, sun = parts({"weather": weather}, fleet=fleet)
    assert fog.across.p is fog.p_holm is sun.p_holm is sun.comparisons is None
    assert (rain.p_holm, rain.comparisons) == (rain.across.p, 1)


def test_the_direction_of_the_rate_is_handed_on() -> None:
    found = strata(FLEET, {"light": LIGHT}, {}, SETTINGS, higher_is_better=True)
    assert [(each.across.worse, each.across.better) for each in found] == [
        (each.across.better, each.across.worse) for each in parts({"light": LIGHT})
    ]
    assert any(each.across.better != each.across.worse for each in found)
