"""The verdict: what the focus has wrong, compared with what, and what to do next."""

from dataclasses import replace

import numpy as np
import pytest

from roadeval import RoadevalError
from roadeval.evaluation import tables
from roadeval.evaluation.comparison.compare import compare, variants_as_sides
from roadeval.evaluation.score.scoreboard import Effect, drive_effects
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.facts import FrameAccount, LogFacts, Member, UnlabelledFacts, focus_of
from roadeval.results.fleet import FleetWriter, Made, results_path
from roadeval.results.folder import ResultsWriter
from roadeval.results.rows import csv_lines
from roadeval.results.schema import TABLES
from roadeval.results.verdict import describe_change, describe_errors, verdict
from tests.evaluation.making import a_difference, a_drive, a_result, a_table, autoregression
from tests.results.making import KEY, facts_of

WORDS = 60
"""At most so many are read once."""
WORSE = a_difference(9.2, 7.1, 11, units=91)
BETTER = replace(WORSE, mean=-0.092, low=-0.11, high=-0.071)
UNSURE = a_difference(-3.3, -20, 3.4, p=0.4, units=91)
ZERO = a_difference(0, 0, 0, p=1.0, units=91)
SHORT = replace(UNSURE, low=None, high=None, p=None, units=3, needed=10)
ONE_SCENE = replace(BETTER, effective=2.1)
OF_DRIVES = replace(BETTER, unit="drives", units=8, groups=8)
OF_MANY = replace(OF_DRIVES, units=500, groups=500)
FEW_DRIVES = replace(SHORT, unit="drives", groups=3, needed=6)


def rates(error, frames=91, **more):
    return {"ERR": error, "FNR": 2 * error, "FPR": error / 2, "frames": frames, **more}


def drive(frames=91, **errors):
    return {name: {"post": rates(error, frames)} for name, error in errors.items()}


def fleet(drives, **errors):
    return {name: {"post": rates(error, drives=drives)} for name, error in errors.items()}


def against(base, **differences):
    return [Effect(base, name, "post", True, {"ERR": d}) for name, d in differences.items()]


def filtered(by_filter, of_blind):
    return [*against("unfiltered", filtered=by_filter), *against("blind", filtered=of_blind)]


PAIR = drive(filtered=0.028, unfiltered=0.12, blind=0.044)
NO_ROAD_FOUND = {"net": {"post": {"ERR": 0.055, "FNR": 0.322, "FPR": 0.0004, "frames": 90}}}
AT = {"own": 0.5, "threshold": 0.0138, "ERR": 0.027, "lines": "threshold = 0.01380"}
CASES = {
    "the filter helps": (
        (PAIR, filtered(BETTER, UNSURE)),
        "filtered: 2.8 % of the pixels are wrong (91 frames). It misses 5.6 % of the road and "
        "takes 1.4 % of the rest for road. That is 3.3 points (may be chance) better than "
        "blind, which "
        "ignores the image, and 9.2 points (7.1\N{EN DASH}11.0 "
        "on other frames) better than without the "
        "filter. Next: try --variant robust.",
    ),
    "the filter harms": (
        (drive(filtered=0.154, unfiltered=0.062), filtered(WORSE, WORSE)[:1]),
        "filtered: 15.4 % of the pixels are wrong (91 frames). It misses 30.8 % of the road and "
        "takes 7.7 % of the rest for road. That is 9.2 points (7.1\N{EN DASH}11.0 "
        "on other frames) worse "
        "than without the filter. There is no baseline: no labelled frame was used for training. "
        "Best here is unfiltered: 6.2 %. Next: try --variant robust.",
    ),
    "both may be chance": ((PAIR, filtered(UNSURE, UNSURE)), None),
    "one scene": (
        (drive(robust=0.028, blind=0.12), against("blind", robust=ONE_SCENE)),
        "robust: 2.8 % of the pixels are wrong (91 frames). It misses 5.6 % of the road and takes "
        "1.4 % of the rest for road. That is 9.2 points better than blind, which ignores the "
        "image. One drive says little about others: 6 would tell.",
    ),
    "a network alone that misses road": (
        (NO_ROAD_FOUND, [], {"net": AT}),
        "net: 5.5 % of the pixels are wrong (90 frames). It misses 32.2 % of the road and takes "
        "almost nothing else for road. There is no baseline: no labelled frame was used "
        "for training.",
    ),
    "a threshold is better": (
        (
            {"net": {"post": rates(0.055) | {"pooled_ERR": 0.055}}, **drive(blind=0.147)},
            against("blind", net=BETTER),
            {"net": AT},
        ),
        "net: 5.5 % of the pixels are wrong (91 frames). It misses 11.0 % of the road and takes "
        "2.8 % of the rest for road. That is 9.2 points (7.1\N{EN DASH}11.0 "
        "on other frames) better than "
        "blind, which ignores the image. Set `threshold = 0.01380`: then 2.7 % are wrong.",
    ),
    "what was brought is the focus": (
        (PAIR | drive(mine=0.019), [*filtered(BETTER, BETTER), *against("blind", mine=BETTER)]),
        None,
    ),
    "what was brought is not the best": (
        (drive(filtered=0.01, unfiltered=0.02, mine=0.05, blind=0.1), against("blind", mine=WORSE)),
        "mine: 5.0 % of the pixels are wrong (91 frames). It misses 10.0 % of the road and takes "
        "2.5 % of the rest for road. That is 9.2 points (7.1\N{EN DASH}11.0 "
        "on other frames) worse than "
        "blind, which ignores the image. Best here is filtered: 1.0 %.",
    ),
    "four variants": (
        (PAIR | drive(robust=0.014, gated=0.06), against("blind", robust=BETTER, gated=WORSE)),
        None,
    ),
    "tuned": ((drive(mine=0.05, mine_tuned=0.03, blind=0.1), against("blind", mine=BETTER)), None),
    "masks of some frames": (
        (drive(unfiltered=0.1) | drive(half=0.01, frames=40), []),
        "half: 1.0 % of the pixels are wrong (40 frames). It misses 2.0 % of the road and takes "
        "0.5 % of the rest for road. There is no baseline: no labelled frame was used for "
        "training.",
    ),
    "as good as the baseline": (
        (drive(net=0.054, blind=0.054), against("blind", net=ZERO)),
        "net: 5.4 % of the pixels are wrong (91 frames). It misses 10.8 % of the road and takes "
        "2.7 % of the rest for road. That is exactly as good as blind, which ignores the image.",
    ),
    "three frames": (
        (drive(3, net=0.1, blind=0.12), against("blind", net=SHORT)),
        "net: 10.0 % of the pixels are wrong (3 frames). It misses 20.0 % of the road and takes "
        "5.0 % of the rest for road. That is 3.3 points better than blind, which ignores the "
        "image. 3 frames are too few for an interval (10 are needed).",
    ),
    "undefined": (
        (drive(net=float("nan")), []),
        "Nothing to compare: ERR is undefined on every frame.",
    ),
    "no truth": (
        ({}, []),
        "Nothing to score: no frame with truth was evaluated.",
    ),
    "a fleet": (
        (fleet(8, robust=0.02, blind=0.1), against("blind", robust=OF_DRIVES)),
        "robust: 2.0 % of the pixels are wrong (8 drives). It misses 4.0 % of the road and "
        "takes 1.0 % of the rest for road. That is 9.2 points (7.1\N{EN DASH}11.0 "
        "on other drives) better "
        "than blind, which ignores the image.",
    ),
    "a fleet of three": (
        (fleet(3, robust=0.02, blind=0.1), against("blind", robust=FEW_DRIVES)),
        "robust: 2.0 % of the pixels are wrong (3 drives). It misses 4.0 % of the road and "
        "takes 1.0 % of the rest for road. That is 3.3 points better than blind, which ignores "
        "the image. 3 drives are too few for an interval (6 are needed).",
    ),
    "a fleet of one": ((fleet(1, robust=0.02, blind=0.1), against("blind", robust=BETTER)), None),
    "a fleet of five hundred": (
        (fleet(500, filtered=0.02, unfiltered=0.1, blind=0.1), filtered(OF_MANY, OF_MANY)),
        None,
    ),
    "the longest": (
        (
            PAIR | drive(filtered=0.154, mine=0.019),
            [*filtered(WORSE, WORSE), *against("blind", mine=BETTER)],
            {"mine": AT},
        ),
        "filtered: 15.4 % of the pixels are wrong (91 frames). It misses 30.8 % of the road and "
        "takes 7.7 % of the rest for road. That is 9.2 points (7.1\N{EN DASH}11.0 "
        "on other frames) worse "
        "than blind, which ignores the image, and 9.2 points (7.1\N{EN DASH}11.0 "
        "on other frames) worse "
        "than without the filter. Best here is mine: 1.9 %.",
    ),
    "a threshold is better, and another variant": (
        (
            {"net": {"post": rates(0.055) | {"pooled_ERR": 0.055}}, **drive(robust=0.01)},
            against("blind", net=ONE_SCENE),
            {"net": AT | {"lines": 'decide = "argmax"\nthreshold = 0.01380'}},
        ),
        "net: 5.5 % of the pixels are wrong (91 frames). It misses 11.0 % of the road and takes "
        "2.8 % of the rest for road. That is 9.2 points better than blind. One drive says "
        "little about "
        'others: 6 would tell. Best here is robust: 1.0 %. Set `decide = "argmax"`, '
        "`threshold = 0.01380`: then 2.7 % are wrong.",
    ),
    "a threshold that is worse here": (
        ({"net": {"post": rates(0.02) | {"pooled_ERR": 0.02}}}, [], {"net": AT}),
        "net: 2.0 % of the pixels are wrong (91 frames). It misses 4.0 % of the road and takes "
        "1.0 % of the rest for road. There is no baseline: no labelled frame was used for "
        "training.",
    ),
    "nothing is road above the best threshold": (
        (
            {"net": {"post": rates(0.4) | {"pooled_ERR": 0.4}}},
            [],
            {"net": AT | {"threshold": 1.0, "ERR": 0.2}},
        ),
        "net: 40.0 % of the pixels are wrong (91 frames). It misses 80.0 % of the road and takes "
        "20.0 % of the rest for road. There is no baseline: no labelled frame was used "
        "for training.",
    ),
    "as good as another, as printed": (
        (drive(mine=0.0104, filtered=0.0101), []),
        "mine: 1.0 % of the pixels are wrong (91 frames). It misses 2.1 % of the road and takes "
        "0.5 % of the rest for road. There is no baseline: no labelled frame was used for "
        "training.",
    ),
    "a rig": ((drive(filtered=0.02, unfiltered=0.03, blind=0.1), filtered(BETTER, BETTER)), None),
}


@pytest.mark.parametrize("case", CASES)
def test_the_verdict_says_how_wrong_compared_with_what_and_what_to_do_next(case):
    given, sentences = CASES[case]
    focus = "filtered" if case == "the longest" else None
    said = verdict(*given, focus=focus)
    for focus in [name for name in given[0] if name != "blind"]:
        assert len(verdict(*given, focus=focus).split()) <= WORDS
    if sentences is not None:
        assert said == sentences


def test_without_truth_it_says_where_to_look_first():
    unlabelled = UnlabelledFacts(90, "net", "entropy", [7, 3], {"net": {"filtered": 0.081}})
    assert verdict({}, [], unlabelled=unlabelled) == (
        "Nothing to score: no frame with truth was evaluated. net and filtered differ on 8.1 % of "
        "the pixels, so one of the two is wrong on at least 4.0 %. Look first at frames 7 and 3: "
        "there net is least sure where road is (entropy of its probability). That is a rank, and "
        "no error rate."
    )


@pytest.mark.parametrize(
    ("variants", "focus"),
    [
        (["filtered", "unfiltered", "blind"], "filtered"),
        (["unfiltered", "blind"], "unfiltered"),
        (["filtered", "unfiltered", "mine", "wide", "blind"], "mine"),
        (["blind"], None),
    ],
)
def test_the_focus_is_what_the_user_brought(variants, focus):
    assert focus_of(variants) == focus


def test_a_focus_that_is_chosen_must_be_there():
    names = ["filtered", "unfiltered", "mine", "blind"]
    assert focus_of(names, "unfiltered") == "unfiltered"
    for wrong, remedy in [("minne", "did you mean mine? There are"), ("blind", "there are")]:
        with pytest.raises(RoadevalError) as raised:
            focus_of(names, wrong)
        assert raised.value.problem == f"there is no variant {wrong}"
        assert raised.value.remedy == f"{remedy} filtered, unfiltered and mine"
        assert raised.value.setting == "output.focus"


def test_the_verdict_on_a_chosen_focus_speaks_of_it_and_its_own_differences():
    totals = PAIR | drive(mine=0.019)
    effects = [*filtered(BETTER, BETTER), *against("blind", mine=BETTER, unfiltered=WORSE)]
    assert verdict(totals, effects, focus="unfiltered") == (
        "unfiltered: 12.0 % of the pixels are wrong (91 frames). It misses 24.0 % of the road and "
        "takes 6.0 % of the rest for road. That is 9.2 points (7.1\N{EN DASH}11.0 "
        "on other frames) worse "
        "than blind, which ignores the image. Best here is mine: 1.9 %."
    )


def test_a_share_that_would_read_as_nothing_is_said_in_words():
    assert describe_errors({"FNR": 0.0004, "FPR": 0.0006}) == (
        "misses almost nothing of the road and takes 0.1 % of the rest for road"
    )
    assert describe_errors({"FNR": float("nan"), "FPR": float("nan")}) == ""


# --- Two masks compared ---------------------------------------------------------------------------

SAME = {"ERR": 0.154}, {"ERR": 0.062}
OTHER = {"ERR": 0.2}, {"ERR": 0.062}


@pytest.mark.parametrize(
    ("change", "ends", "sentence"),
    [
        (
            BETTER,
            SAME,
            "new is better than old: 6.2 % wrong instead of 15.4 % (91 frames). On other "
            "frames by 7.1 "
            "to 11.0 points.",
        ),
        (
            WORSE,
            OTHER,
            "new is worse than old: by 9.2 points (91 frames). On other "
            "frames by 7.1 to 11.0 points.",
        ),
        (UNSURE, OTHER, "new is better than old: by 3.3 points (91 frames). This may be chance."),
        (
            replace(BETTER, p_holm=0.06, comparisons=5),
            SAME,
            "new is better than old: 6.2 % wrong instead of 15.4 % (91 frames). This may be "
            "chance, as 5 masks are compared.",
        ),
        (
            ONE_SCENE,
            SAME,
            "new is better than old: 6.2 % wrong instead of 15.4 % (91 frames). One drive says "
            "little about others: 6 would tell.",
        ),
        (
            SHORT,
            OTHER,
            "new is better than old: by 3.3 points (3 frames). 3 frames are too few for an "
            "interval (10 are needed).",
        ),
        (ZERO, SAME, "new is exactly as good as old (91 frames)."),
        (replace(ZERO, units=0), SAME, "Nothing to compare: ERR is undefined on every frame."),
        (
            replace(OF_DRIVES, groups=7, better=7, worse=1),
            SAME,
            "new is better than old: 6.2 % wrong instead of 15.4 % (8 drives in 7 groups, better "
            "on 7, worse on 1). On other drives by 7.1 to 11.0 points.",
        ),
    ],
)
def test_a_comparison_says_what_is_better_by_how_much_and_whether_elsewhere(change, ends, sentence):
    assert describe_change(change, "new", "old", ends) == sentence


# --- A replay, the comparison of its variants and a fleet of that drive judge alike ---------------


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


VARIANTS = [
    ["filtered", "unfiltered"],
    ["filtered", "unfiltered", "gated", "close", "same"],
    ["unfiltered", "robust", "gated"],
]


@pytest.mark.parametrize("variants", VARIANTS)
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
