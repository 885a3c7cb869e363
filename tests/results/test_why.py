"""Why a variant errs: what is confirmed of its classes, conditions and disturbances."""

from dataclasses import replace

import pandas as pd

from roadeval.evaluation.score.degradation import Degradation
from roadeval.evaluation.stats.slices import FrameCondition, Slice
from roadeval.results.facts import Facts, Reason
from roadeval.results.tables import read_table
from roadeval.results.why import explain
from tests.evaluation.making import a_difference
from tests.results.making import facts_of
from tests.results.test_verdict import rates

SHADE = Slice([FrameCondition("shadow", ">", 0.3)], "", 40, 0.3, 0.1, 3.0, 2.0, 4.0, 0.01, [7, 21])
SURE = replace(a_difference(3, 1, 5), p_holm=0.002, comparisons=2)
SHADY = "In frames with more than 30 % shade"
FOG = {"fog-2": Degradation("fog", 2, 0.05, 0.02, SURE)}
CLASSES = pd.DataFrame(
    [
        ("road", "road", 9000, 8000, 0, "8 12"),
        ("pavement", "other", 5000, 900, 600, "50 3"),
        ("car", "other", 4000, 300, 400, "9"),
    ],
    columns=["name", "truth", "pixels", "road", "beside", "worst"],
).assign(drive="street", camera="/camera", variant="mine", frames=10, **{"class": [3, 4, 8]})
FACTS = facts_of(
    totals={"mine": {"post": rates(0.02)}, "blind": {"post": rates(0.1)}},
    slices={"mine": [SHADE, replace(SHADE, part="left")]},
    disturbances={"mine": FOG},
)
NO_CLASSES = read_table("classes", "")


def test_at_most_four_sentences_name_class_condition_and_disturbance_with_their_frames():
    assert explain(FACTS, CLASSES)["mine"] == [
        Reason("75 % of the false road is pavement, 25 % car.", [50, 3]),
        Reason("60 % of the missed road lies beside pavement, 40 % beside car.", [8, 12]),
        Reason(
            "In frames with more than 30 % shade, ERR is 3.0 times the rest (2.0 to 4.0).", [7, 21]
        ),
        Reason("fog:2 raises the ERR of mine from 2.0 to 5.0 % (2.5 times as high).", []),
    ]
    assert {*explain(FACTS, CLASSES)} == {"mine"}


def test_masks_or_truth_that_do_not_fit_explain_enough_and_a_part_of_the_image_is_no_reason():
    assert explain(replace(FACTS, misfits=["The truth is late."]), CLASSES) == {}
    of_rows = replace(SHADE, conditions=[], part="rows_40-60")
    facts = replace(FACTS, slices={"mine": [of_rows]}, disturbances={})
    assert explain(facts, NO_CLASSES) == {}


def test_what_may_be_chance_and_what_is_rare_is_no_reason():
    chance = {"fog-2": replace(FOG["fog-2"], difference=replace(SURE, p_holm=0.3))}
    facts = replace(FACTS, slices={"mine": []}, disturbances={"mine": chance})
    assert explain(facts, NO_CLASSES) == {}
    rare = CLASSES.assign(pixels=10**7 * (CLASSES["truth"] == "other") + CLASSES["pixels"])
    assert (
        explain(facts, rare.assign(road=rare["road"].where(rare["truth"] == "other", 9000))) == {}
    )


def test_frames_of_several_drives_are_not_named():
    of_drives = replace(SHADE, worst=[7], drives=["lane"])
    facts = replace(FACTS, slices={"mine": [of_drives]}, disturbances={})
    (reason,) = explain(facts, NO_CLASSES)["mine"]
    assert reason.frames == []


def test_reasons_are_read_back_as_they_were_written():
    facts = replace(FACTS, why=explain(FACTS, CLASSES))
    assert Facts.parse(facts.text(), "here").why == facts.why
