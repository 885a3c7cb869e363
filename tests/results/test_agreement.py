"""A replay, the comparison of its variants and a fleet of that drive judge alike."""

import numpy as np
import pytest

from roadeval.evaluation import tables
from roadeval.evaluation.comparison.compare import compare, variants_as_sides
from roadeval.evaluation.score.scoreboard import drive_effects
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.facts import FrameAccount, LogFacts, Member
from roadeval.results.fleet import FleetWriter, Made, results_path
from roadeval.results.folder import ResultsWriter
from roadeval.results.rows import csv_lines
from roadeval.results.schema import TABLES
from roadeval.results.verdict import verdict
from tests.evaluation.making import a_drive, a_result, a_table, autoregression
from tests.results.making import KEY, facts_of

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


def errors_of(variants):
    """The wrong pixels of a drive with these variants."""
    return {(name, "post"): DRIVE[name, "post"].tolist() for name in [*variants, "blind"]}


def replayed(errors):
    """The rows of a drive, its totals, its differences and its verdict."""
    rows = a_table(errors)
    totals, effects = tables.as_trees(tables.totals(rows)), drive_effects(rows, SETTINGS)
    return rows, totals, effects, verdict(totals, effects)


def a_fleet_of(errors, folder):
    """The facts of a fleet of this drive."""
    rows, totals, effects, _ = replayed(errors)
    account, log = FrameAccount(evaluated=rows["frame"].nunique()), LogFacts("street.mcap", "d1")
    facts = facts_of(totals=totals, effects=effects, frames=account, log=log)
    writer = FleetWriter(folder)
    writer.begin()
    with ResultsWriter(results_path(folder, "street")) as results:
        cells = rows[[*TABLES["frames"].names[2:]]].itertuples(index=False, name=None)
        results.append(csv_lines(KEY, {"frames": cells}))
        results.finish(facts, "")
    Made("street", "asked", None).write(folder)
    return writer.finish([Member("street", "street", "street.mcap")], SETTINGS, {}, "")


CASES = [
    ["filtered", "unfiltered"],
    ["filtered", "unfiltered", "gated", "close", "same"],
    ["unfiltered", "robust", "gated"],
]


@pytest.mark.parametrize("variants", CASES)
def test_all_three_judge_the_same_difference_alike(variants, tmp_path):
    errors = errors_of(variants)
    _, _, effects, told = replayed(errors)
    sides = variants_as_sides(a_result("street", a_drive(errors)), variants)
    changes = compare(sides, SETTINGS, across_variants=True).changes
    of_replay = {e.variant: e.rates["ERR"] for e in effects if e.base == "unfiltered"}
    of_compare = {change.variant: change.difference["ERR"] for change in changes}
    assert of_compare == of_replay
    assert {each.comparisons for each in of_replay.values()} <= {
        None,
        sum(not each.is_zero for each in of_replay.values()),
    }
    fleet = a_fleet_of(errors, tmp_path / "fleet")
    assert fleet.verdict == told
    of_fleet = {e.variant: e.rates["ERR"] for e in fleet.effects if e.base == "unfiltered"}

    def facts(each):
        return each.mean, each.low, each.high, each.p, each.p_holm, each.comparisons

    assert {n: facts(e) for n, e in of_fleet.items()} == {n: facts(e) for n, e in of_replay.items()}
