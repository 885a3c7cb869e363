"""What a difference and a comparison tell: how sure it is, in words."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from benchmarks.slices import make_fleet
from roadeval.data import Counts
from roadeval.evaluation import metrics
from roadeval.evaluation.comparison.compare import RegionChange
from roadeval.evaluation.comparison.conditions import Condition
from roadeval.evaluation.score.degradation import Degradation
from roadeval.evaluation.stats.slices import FrameCondition, Slice
from roadeval.results import comparison
from roadeval.results.comparison import (
    changed_settings,
    describe_judgement,
    headline,
)
from roadeval.results.facts import Facts, Reason
from roadeval.results.over_drives import slices_over_drives
from roadeval.results.sentences import notes
from roadeval.results.tables import read_table
from roadeval.results.why import describe_disturbances, explain, with_doubts
from tests.evaluation.making import a_change, a_comparison, a_difference
from tests.results.making import facts_of
from tests.results.test_verdict import rates

# --- Notes on a frame -----------------------------------------------------------------------------


def with_error(percent: int, road: int = 50) -> dict[str, float]:
    """Rates of a frame of 100 pixels, of which ``percent`` are called road wrongly."""
    return metrics.of(Counts(tp=road, tn=100 - road - percent, fp=percent, fn=0))


def test_a_failure_is_noted_with_its_reason() -> None:
    missed = metrics.of(Counts(tp=1, tn=80, fp=0, fn=19))
    assert tuple(notes({"net": missed})) == ("net finds 5.0 % of the road.",)
    wrong = tuple(notes({"net": with_error(30)}))
    assert wrong == ("net gets 30.0 % of the pixels wrong.",)


WORSE = a_difference(1.2, 0.5, 2)


def test_masks_of_which_nothing_changed_are_named_in_one_sentence():
    same = a_difference(0, 0, 0)
    rows = a_change(WORSE), a_change(same, "net"), a_change(same, "wide")
    told = comparison.verdict(a_comparison(*rows))
    assert told.count("(12 frames)") == 1
    assert told.endswith("net and wide of new: every frame as in base.")
    # ERR alone may stay where other rates change.
    moved = replace(rows[1], difference={**rows[1].difference, "FPR": WORSE})
    text = comparison.verdict(a_comparison(rows[0], moved))
    assert "net of new is exactly as good as base" in text


@pytest.mark.parametrize(
    ("row", "why"),
    [
        (a_difference(8, 0.1, 17, p_holm=0.4, comparisons=9), "as 9 regions are compared"),
        (a_difference(8, -1, 17, p=0.1, p_holm=0.4, comparisons=9), "each change may be chance"),
        (a_difference(8), "no interval, as 12 frames are too few for an interval"),
    ],
)
def test_why_no_region_is_sure_is_told(row, why):
    part = RegionChange("new", "net", "lit", "in light", 12, 0.1, 0.2, row)
    assert why in comparison.where(a_comparison(a_change(WORSE, "net"), regions=(part,)))[0]


def test_a_region_without_an_interval_hides_no_other():
    few, known = replace(a_difference(8), units=2), a_difference(8, -1, 17)
    told = [comparison.why_unsure(rows) for rows in ([few, known], [few, a_difference(8)])]
    assert told[0] == "each change may be chance"
    assert told[1].startswith("no interval, as 12 frames are too few for an interval")
    assert " and " not in told[1]


def test_changed_settings_are_told_of_each_result_and_some_of_many():
    chains = ["svm"], ["trees", "post"]
    settings = {"preset": ("paper", "gated"), "chain": chains, "svm.c": (1, 2)}
    changed = {"new": settings}
    found = a_comparison(a_change(WORSE), changed_settings=changed)
    assert changed_settings(found) == [
        "Changed settings: preset paper to gated; chain svm to trees, post; svm.c 1 to 2."
    ]
    rows = a_change(WORSE), a_change(WORSE, result="newer")
    several = a_comparison(*rows, changed_settings=changed)
    assert changed_settings(several, 1) == [
        "Changed settings in new: preset paper to gated; and 2 more."
    ]


@pytest.mark.parametrize(
    ("holds", "said"),
    [
        ([False], "passed, 1 limit kept"),
        ([False, False], "passed, 2 limits kept"),
        ([True], "failed, 1 of 1 limits exceeded"),
        ([True, None, False], "failed, 1 of 3 limits exceeded and 1 of 3 limits not judged"),
    ],
)
def test_the_headline_says_whether_limits_were_kept(holds, said):
    assert headline(holds) == said


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("post.filtered.ERR > 1pp", "changed by +1.20 points, from 10.00 % to 11.20 % (limit: {})"),
        (
            "post.filtered.ERR > 1pp surely",
            "changed by +1.20 points [+0.50, +2.00], from 10.00 % to 11.20 % (limit: {})",
        ),
        ("post.filtered.ERR > 11%", "is 11.20 % (limit: {})"),
    ],
)
def test_a_judged_condition_is_told_with_the_numbers_that_it_rests_on(text, told):
    judgement = Condition.parse(text).judge(a_change(WORSE))
    assert describe_judgement(judgement) == f"post.filtered.ERR of new {told.format(text)}"
    assert " over 8 drives" in describe_judgement(replace(judgement, drives=8))


# --- Disturbances ---------------------------------------------------------------------------------


def disturbed(*ends: float, p: float | None = None) -> dict[str, Degradation]:
    """Fog of rising strength; ``ends`` are ERR in percent, the first without a disturbance."""
    base, *errors = ends
    return {
        f"fog-{strength}": Degradation(
            *("fog", strength, error / 100, base / 100),
            replace(a_difference(error - base, -9, 9), p_holm=p),
        )
        for strength, error in enumerate(errors, 1)
    }


def test_what_harms_most_on_these_frames_is_told_though_it_may_be_chance():
    changes = disturbed(2, 9, 3)
    sure = replace(changes["fog-2"].difference, p_holm=0.001)
    changes["fog-2"] = replace(changes["fog-2"], difference=sure)
    sentence = describe_disturbances({"net": changes}, "net")
    assert sentence.startswith("fog:1 raises the ERR of net from 2.0 to 9.0 %")
    assert sentence.endswith("2 of 2 disturbances raise it, 1 beyond chance.")


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (disturbed(2.8, 5.9), "fog:1 raises the ERR of net from 2.8 to 5.9 % (2.1 times as high)."),
        (disturbed(2, 2.2), "fog:1 raises the ERR of net from 2.0 to 2.2 %."),
        (
            disturbed(2, 6, 1),
            "fog:1 raises the ERR of net from 2.0 to 6.0 % (3 times as high). 1 of 2 disturbances "
            "raise it, 0 beyond chance.",
        ),
        (disturbed(0, 9), "fog:1 raises the ERR of net from 0.0 to 9.0 %."),
        (disturbed(2, 1.9), "No disturbance makes net worse."),
        (
            disturbed(2, 3, 3.2, p=0.001),
            "fog:2 raises the ERR of net from 2.0 to 3.2 % (1.6 times as high). "
            "2 of 2 disturbances raise it, 2 beyond chance.",
        ),
    ],
)
def test_what_harms_most_is_told_in_one_sentence(changes, sentence):
    assert describe_disturbances({"net": changes}, "net") == sentence
    assert describe_disturbances({"net": changes}, "masks") == sentence
    assert not describe_disturbances({}, "net")


# --- Why a variant errs: what is confirmed of its classes, conditions and disturbances ------------


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


def test_doubts_about_labels_come_first_and_at_most_four_reasons_are_kept():
    facts = replace(FACTS, why=explain(FACTS, CLASSES))
    doubts = ["The label of frame 3 looks wrong.", "b and the truth differ."]
    told = with_doubts(facts, doubts).why
    assert facts.why
    for name, reasons in facts.why.items():
        expected = [*doubts, *(reason.sentence for reason in reasons)][:4]
        assert [reason.sentence for reason in told[name]] == expected
    assert with_doubts(facts, []) == facts


# --- Slices over drives: tags, and times of the drive and of the day, are conditions, too ---------


def slices_of(frames, conditions, regions, parts, drives):
    tables = {
        "conditions": conditions.drop(columns=["group", "tag_weather"]),
        "frames": frames.assign(variant="net", stage="post", final=True),
        "regions": regions.rename(columns={"wrong": "FP"}).assign(FN=0, variant="net"),
        "parts": parts.assign(variant="net"),
    }
    names = dict(zip(drives["drive"], drives["drive"], strict=True))
    slices = slices_over_drives(lambda name, _: tables[name], drives, names, 0.95)
    return slices.get("net", [])


@pytest.mark.parametrize(("drives", "named"), [(40, True), (0, False)])
def test_a_tag_of_a_drive_is_a_condition_and_a_fleet_without_drives_has_none(drives, named):
    real = pd.DataFrame({"brightness": np.linspace(0, 1, 60)})
    frames, conditions, parts = make_fleet(np.random.default_rng(6), [real], 40)
    names, weathers = zip(*conditions.groupby("drive")["tag_weather"].first().items(), strict=True)
    table = pd.DataFrame({"drive": names, "evaluated": 60, "tag_weather": weathers})[:drives]
    frames.loc[(conditions["tag_weather"] == "rain").to_numpy(), "FP"] *= 4
    slices = slices_of(frames, conditions, parts, parts[:0], table)
    conditions_named = [confirmed.conditions for confirmed in slices]
    assert ([FrameCondition("tag_weather", "is", "rain")] in conditions_named) == named


@pytest.mark.parametrize("part", ["left", "on verge"])
def test_a_half_and_a_class_are_parts_of_a_fleet(part):
    real = pd.DataFrame({"brightness": np.linspace(0, 1, 60)})
    frames, conditions, regions = make_fleet(np.random.default_rng(6), [real], 40)
    drives = pd.DataFrame({"drive": conditions["drive"].unique(), "evaluated": 60})
    # A class is named under conditions alone: the table of classes has its errors.
    is_worse = (conditions["brightness"] > 0.6) | (part == "left")
    wrong = (frames["FP"] + frames["FN"]) * np.where(is_worse, 0.8, 0.2)
    half = frames[["drive", "camera", "frame"]].assign(N=frames["N"] // 2)
    parts = half.assign(region=part, wrong=wrong.astype(int))
    slices = slices_of(frames, conditions, regions, parts, drives)
    assert [s.part for s in slices] == [part]
    assert [c.quantity for c in slices[0].conditions] == ["brightness"] * (part != "left")
    assert slices[0].ratio > 1.5
    assert slices_of(frames, conditions, regions, parts[:0], drives) == []
