"""A replay, the comparison of its variants and a fleet of that drive judge alike."""

import numpy as np
import pytest

from roadeval.evaluation import score
from roadeval.evaluation.comparison import Side, compare, variants_as_sides
from roadeval.evaluation.score import drive_effects
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.facts import DriveFacts, Facts, FrameAccount, Member, as_parts
from roadeval.results.fleet import FleetWriter, Record
from roadeval.results.rows import Key, cells, effect_rows, score_rows
from roadeval.results.sentences import sentence, verdict
from tests.evaluation.making import a_table, autoregression, compared_drive, rows_of

SETTINGS = EvaluationSettings()
RNG = np.random.default_rng(11)
SHIFTS = {
    "unfiltered": (0, 0.2),
    "filtered": (8, 6),
    "robust": (-9, 2),
    "gated": (-0.7, 1.5),
    "close": (0.2, 0.3),
    "same": (0, 0),
    "blind": (3, 5),
}
"""The mean change of each variant's ERR in points, and how much it varies."""
BASE = 20 + 3 * autoregression(RNG, 91, 0.9)
DRIVE = {
    (name, "post"): np.rint(BASE + shift + spread * autoregression(RNG, 91, 0.9)).astype(int)
    for name, (shift, spread) in SHIFTS.items()
}
DRIVE["same", "post"] = DRIVE["unfiltered", "post"]


def a_drive(variants):
    """The rows of a drive with these variants."""
    names = [*variants, "blind"]
    return rows_of(a_table({(name, "post"): DRIVE[name, "post"].tolist() for name in names}))


def totals_of(rows):
    return score.totals(score.camera_masks(rows))


def replayed(rows):
    effects = drive_effects([score.camera_masks(rows)], SETTINGS)
    return effects, verdict(totals_of(rows), effects)


def a_fleet_of(rows, folder):
    """The facts of a fleet of this drive."""
    effects, _ = replayed(rows)
    about = "", DriveFacts("street"), FrameAccount(), totals_of(rows)
    facts = Facts(*about, **as_parts(effects))
    about = {"status": "scored", "evaluated": len(rows.distinct("frame")), "log_digest": "d1"}
    tables = {
        "drives": [about],
        "scores": score_rows(facts, {}),
        "effects": effect_rows(facts),
        "worst": [],
    }
    key = Key("street", "/camera")
    writer, member = FleetWriter(folder), Member("street", "street", "street.mcap")
    writer.begin()
    made = {name: cells(name, key, own) for name, own in tables.items()}
    Record("street", "asked", None, made).write(folder)
    return writer.finish([member], SETTINGS, {}, "")


CASES = [
    ["filtered", "unfiltered"],
    ["filtered", "unfiltered", "robust"],
    ["filtered", "unfiltered", "robust", "gated"],
    ["filtered", "unfiltered", "gated", "close", "same"],
    ["unfiltered", "robust", "gated"],
]


@pytest.mark.parametrize("variants", CASES)
def test_all_three_judge_the_same_difference_alike(variants, tmp_path):
    rows = a_drive(variants)
    effects, told = replayed(rows)
    sides = variants_as_sides(Side("street", [compared_drive({"frames": rows})]), variants)
    changes = compare(sides, SETTINGS, across_variants=True).changes
    of_replay = {e.variant: e.rates["ERR"] for e in effects if e.base == "unfiltered"}
    of_compare = {change.variant: change.difference["ERR"] for change in changes}
    assert of_compare == of_replay
    assert {each.comparisons for each in of_replay.values()} <= {
        None,
        sum(not each.is_zero for each in of_replay.values()),
    }
    fleet = a_fleet_of(rows, tmp_path / "fleet")
    assert fleet.verdict == told
    of_fleet = {e.variant: e.rates["ERR"] for e in fleet.effects if e.base == "unfiltered"}

    def facts(each):
        return each.mean, each.low, each.high, each.p, each.p_holm, each.comparisons

    assert {n: facts(e) for n, e in of_fleet.items()} == {n: facts(e) for n, e in of_replay.items()}


def test_the_sentence_of_a_replay_is_that_of_the_comparison_but_for_what_brings_it_about():
    rows = a_drive(CASES[2])
    effects, told = replayed(rows)
    (effect,) = (e for e in effects if (e.base, e.variant) == ("unfiltered", "filtered"))
    found, totals = effect.rates["ERR"], totals_of(rows)
    ends = totals["unfiltered"]["post"], totals["filtered"]["post"]
    said = sentence(found, "the filter", "ERR of post", ends)
    assert " from " in said
    assert told.endswith(said)
