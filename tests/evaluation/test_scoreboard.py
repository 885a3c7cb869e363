"""A drive's score: sums, health, claims, differences, and doubts about frames without truth."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from roadeval.data import (
    IGNORE,
    Change,
    Counts,
    Health,
    Output,
    Packed,
    Role,
    StageResult,
    TruthBits,
    VariantResult,
)
from roadeval.evaluation import metrics, tables
from roadeval.evaluation.score import counts
from roadeval.evaluation.score.counts import error_map
from roadeval.evaluation.score.frame import BlindPrior, judge
from roadeval.evaluation.score.scoreboard import Scoreboard, drive_effects, episodes, evidence
from roadeval.evaluation.score.thresholds import HeatMap
from roadeval.evaluation.score.unlabelled import (
    Unlabelled,
    choose_frames,
    doubts_of,
    entropy,
    sign_of,
)
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import concatenate
from tests.evaluation.making import a_frame, a_table, a_variant, pixels, table_of
from tests.results.making import KEY, frames_of

TRUTH = pixels("##..", "##.?")
FILTERED = a_variant(
    "filtered", {"svm": pixels("#...", "#..."), "post": pixels("##..", "#...")}, {"lit": TRUTH}
)
UNFILTERED = a_variant("unfiltered", {"svm": TRUTH, "post": pixels("##..", "##..")})


def a_board(prior=None, window=10):
    settings = EvaluationSettings(window=window, boundary_width=1, bands=2)
    return Scoreboard(KEY, settings, ["filtered", "unfiltered"], prior)


def test_the_tables_of_the_run_are_those_that_its_rows_read_back_as():
    """The second variant misses the first frames; the baseline comes last in every table."""
    board, results = a_board(BlindPrior.of_truths([TRUTH]), window=5), []
    for number in range(12):
        variants = (FILTERED, UNFILTERED)[: 1 + (number > 2)]
        results.append(board.score(a_frame(TRUTH, number), Role.EVALUATED, variants))
        board.add(results[-1])
    sums, read = board.summary(), frames_of(results)
    ours = board.frames().sort_values(["frame", "variant", "stage"])
    theirs = read.drop(columns=["log_time_ns", "truth"])
    theirs = theirs.assign(
        variant=theirs["variant"].cat.set_categories(ours["variant"].cat.categories)
    )
    theirs = theirs.sort_values(["frame", "variant", "stage"])
    for name in theirs:
        assert ours[name].astype(theirs[name].dtype).tolist() == pytest.approx(
            theirs[name].tolist(), nan_ok=True
        )
    assert sums.parts["totals"] == tables.as_trees(tables.totals(read))
    assert [*sums.parts["totals"]] == ["filtered", "blind", "unfiltered"]
    assert sums.windows["variant"].unique().tolist() == ["filtered", "unfiltered", "blind"]
    assert sums.parts["windows"] == 3


@pytest.mark.parametrize("role", [Role.TRAINING, Role.GAP, Role.UNLABELLED])
def test_only_evaluated_frames_are_counted(role):
    board = a_board()
    truth = None if role is Role.UNLABELLED else TRUTH
    result = board.score(a_frame(truth), role, (FILTERED,))
    board.add(result)
    assert result.tallies == ()
    assert board.roles() == {role: 1}
    sums = board.summary()
    assert (len(sums.frames), len(sums.windows), sums.effects) == (0, 0, [])
    assert (sums.parts["totals"], sums.parts["windows"], sums.parts["claims"]) == ({}, 0, {})


def test_health_is_judged_and_counted_by_final_masks():
    board = a_board()
    for number in range(3):
        result = board.score(a_frame(TRUTH, number), Role.EVALUATED, (FILTERED, UNFILTERED))
        board.add(result)
    assert result.health == {"filtered": Health.OK, "unfiltered": Health.OK}
    assert board.summary().parts["health"] == {"filtered": {"ok": 3}, "unfiltered": {"ok": 3}}


def test_a_frame_that_ignores_every_pixel_has_undefined_rates_and_is_counted_so():
    board = a_board()
    frame = a_frame(np.full_like(TRUTH, 255))
    board.add(board.score(frame, Role.EVALUATED, (FILTERED,)))
    totals = board.summary().parts["totals"]["filtered"]["post"]
    assert (totals["N"], totals["undefined"]["ERR"]) == (0, 1)
    assert math.isnan(totals["ERR"])


# --- The mask that never looks at the image -------------------------------------------------------


def test_the_prior_is_the_mean_truth():
    prior = BlindPrior.of_truths([pixels("##.."), pixels("#.#."), pixels("#...")])
    assert prior.road.dtype == np.float32
    assert prior.road == pytest.approx(np.array([[1, 1 / 3, 1 / 3, 0]]))


def test_ignored_pixels_are_left_out_of_the_mean():
    prior = BlindPrior.of_truths([pixels("?#?"), pixels("##?")])
    assert prior.road.tolist() == [[1, 1, 0]]


def test_the_mask_fits_a_frame_of_another_size():
    prior = BlindPrior.of_truths([pixels("..##", "..##")])
    assert (prior.mask((4, 8)).pixels() == pixels(*["....####"] * 4)).all()


def test_truths_of_several_sizes_make_one_prior():
    prior = BlindPrior.of_truths([pixels("..##"), pixels(*["....####"] * 2)])
    assert prior.road.tolist() == [[0, 0, 1, 1]]


# --- When a frame is fine, degraded or failed -----------------------------------------------------


@pytest.mark.parametrize(
    ("counts", "blind", "health"),
    [
        (Counts(50, 35, 15, 0), None, Health.DEGRADED),
        (Counts(50, 25, 25, 0), None, Health.FAILED),
        (Counts(0, 95, 0, 5), None, Health.FAILED),  # it finds no road, however little there is
        (Counts(tn=100), None, Health.OK),
        (Counts(tn=70, fp=30), None, Health.FAILED),
        (Counts(50, 42, 8, 0), Counts(50, 43, 7, 0), Health.OK),
        (Counts(50, 42, 8, 0), Counts(50, 45, 5, 0), Health.DEGRADED),
    ],
)
def test_a_frame_is_judged_by_its_errors_its_road_and_the_baseline(counts, blind, health):
    assert judge(metrics.of(counts), blind and metrics.of(blind)) is health


# --- The paper's claims, on windows written by hand -----------------------------------------------

FRAMES = [10, 10, 10, 3]


def claims(**masks):
    """The evidence of windows of masks, each with one value for every rate."""
    rows = [
        {"window": number, "frames": FRAMES[number], "variant": variant, "stage": stage}
        | dict.fromkeys(("ERR", "FPR", "FNR"), err)
        for mask, errs in masks.items()
        for variant, stage in [mask.split("_")]
        for number, err in enumerate(errs)
    ]
    found = evidence(table_of("windows", rows), 10)
    return {name: tuple(counted.values()) for name, counted in found.items()}


def test_claims_are_counted_apart_in_full_windows_and_shorter_ones():
    """Held and in all, of full windows and then of shorter ones."""
    found = claims(filtered_post=[0.1, 0.3, 0.1, 0.1], unfiltered_post=[0.2] * 4)
    assert found["filter_ERR"] == (2, 3, 1, 1)
    equal = claims(filtered_post=[0.1, 0.2, math.nan], unfiltered_post=[0.2] * 3)
    assert equal["filter_FNR"] == (1, 2, 0, 0)
    stages = claims(filtered_similarity=[0.3], filtered_svm=[0.2], filtered_post=[0.25])
    assert stages == {"svm_ERR": (1, 1, 0, 0), "post_ERR": (0, 1, 0, 0)}
    assert evidence(tables.windows(table_of("frames", []), 10), 10) == {}
    assert evidence(pd.DataFrame(columns=["variant", "stage"]), 10) == {}


@pytest.mark.parametrize("sizes", [(10, 9), (9, 10)])
def test_a_window_is_full_if_both_masks_have_all_its_frames(sizes):
    masks = zip(("filtered", "unfiltered"), sizes, (0.1, 0.2), strict=True)
    rows = [
        {"window": 0, "frames": size, "variant": name, "stage": "post"}
        | dict.fromkeys(("ERR", "FPR", "FNR"), err)
        for name, size, err in masks
    ]
    counts = evidence(table_of("windows", rows), 10)["filter_ERR"]
    assert counts == {"held": 0, "windows": 0, "short_held": 1, "short": 1}


def variant(name, mask, codes=None):
    output = Output(mask=Packed.of(mask), probability=codes)
    return VariantResult(name, (StageResult("post", output, 0.0),))


def of_one_camera(*names):
    return Scoreboard(("street", "/camera"), EvaluationSettings(), names, None)


def seen(board, number, *variants, truth=None):
    """Score and add a frame; return its doubts."""
    frame = a_frame(truth, number=number)
    role = Role.UNLABELLED if truth is None else Role.EVALUATED
    return board.add(board.score(frame, role, variants))


def test_entropy_is_scipy_s_on_every_fourth_pixel():
    codes = np.random.default_rng(0).integers(0, 65536, (64, 96)).astype(np.uint16)
    p = codes[::4, ::4].ravel() / 65535
    assert entropy(codes) == pytest.approx(stats.entropy([p, 1 - p], base=2).mean(), abs=1e-6)


def test_disagreement_is_the_mean_share_of_differing_pixels_over_the_others():
    a, b, c = pixels("##.."), pixels("#..."), pixels("....")
    first, second, third = doubts_of([variant("a", a), variant("b", b), variant("c", c)])
    assert first.differs == {"b": 0.25, "c": 0.5}
    assert [e.disagreement for e in (first, second, third)] == [0.375, 0.25, 0.375]
    assert np.isnan([first.entropy, doubts_of([variant("a", a)])[0].disagreement]).all()


def test_flicker_counts_pixels_that_change_and_begins_anew_after_a_gap():
    board = of_one_camera("a")
    flicker = [
        seen(board, 0, variant("a", pixels("##.."))),
        seen(board, 1, variant("a", pixels("#.#."))),
    ]
    board.lose()
    flicker += [seen(board, 3, variant("a", pixels("....")))]
    seen(board, 4, variant("a", pixels("....")), truth=pixels("...."))
    flicker += [seen(board, 5, variant("a", pixels("####")))]
    found = [own[0].flicker for own in flicker]
    assert found == pytest.approx([np.nan, 0.5, np.nan, np.nan], nan_ok=True)


def test_frames_with_truth_and_training_frames_have_no_doubt():
    board = of_one_camera("a")
    assert seen(board, 0, variant("a", pixels("#...")), truth=pixels("#...")) == ()
    found = board.score(a_frame(None, number=1), Role.TRAINING, (variant("a", pixels("#...")),))
    assert found.doubts == ()


def test_a_variant_is_ranked_by_the_first_sign_that_it_has():
    found = {}
    for names in (("sure", "plain"), ("plain", "sure")):
        board, codes = of_one_camera(*names), {"sure": np.full((1, 4), 20000, np.uint16)}
        for number in range(2):
            masks = {"sure": pixels("#..."), "plain": pixels("....")}
            seen(board, number, *(variant(name, masks[name], codes.get(name)) for name in names))
        found[names[0]] = sign_of(board.unlabelled.rows())
    assert found == {"sure": "entropy", "plain": "disagreement"}
    assert sign_of(Unlabelled("").rows()) is None


def test_frames_without_truth_rank_by_the_focus():
    board = Scoreboard(("street", "/camera"), EvaluationSettings(), ["a", "b"], None, focus="b")
    seen(board, 0, variant("a", pixels("##..")), variant("b", pixels("....")))
    rows = board.unlabelled.rows()
    assert [*rows["variant"]] == ["b"]


def test_where_there_is_no_room_for_the_whole_distance_it_is_halved_and_not_given_up():
    stamps = np.arange(900) * 10**9 // 30
    random, ranked = choose_frames(stamps, np.linspace(1, 2, 900), 60, seed=0)
    assert len(random) == len(ranked) == 30
    places = np.sort(np.concatenate([random, ranked]))
    beside = np.minimum(np.diff(places, prepend=-900), np.diff(places, append=1800))
    assert beside[np.isin(places, ranked)].min() >= 7  # a quarter of the 30 frames of a second


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


def test_final_masks_of_different_stages_are_subtracted_and_what_was_tuned_from_its_method():
    assert of(("unfiltered", "svm"), ("filtered", "svm"), ("filtered", "smooth")) == [
        ("unfiltered", "filtered", "svm", False),
        ("unfiltered", "filtered", "smooth", True),
    ]
    tuned = of(("net", "post"), ("net_tuned", "post"), ("other", "post"))
    assert tuned == [("net", "net_tuned", "post", True)]


def test_a_difference_is_the_variant_minus_the_base_on_the_frames_that_both_have():
    pair = {("filtered", "post"): [10, 10, 90], ("unfiltered", "post"): [7, 9]}
    (effect,) = effects_of(pair)
    found = effect.rates["ERR"]
    assert (found.units, found.mean) == (2, pytest.approx(0.02))
    assert [*effect.rates] == ["ACC", "ERR", "FNR", "FPR"]


def test_each_camera_counts_the_same_in_a_difference():
    front = {("filtered", "post"): [12] * 30, ("unfiltered", "post"): [10] * 30}
    rear = {("filtered", "post"): [14] * 10, ("unfiltered", "post"): [10] * 10}
    rig = concatenate([a_table(front), a_table(rear, camera="/rear")])
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


# --- Where pixels go wrong over a drive, what a step changed, and how long a mask errs ------------


MAP_TRUTH = pixels("##..", "##.?")


def changes(masks, truth):
    """Count the changes between masks that are not packed yet."""
    packed = TruthBits.of(truth)
    bits = packed.bits_of(Packed.of(mask) for _, _, mask in masks)
    return counts.changes([(variant, stage) for variant, stage, _ in masks], bits, packed)


SIDE = 8


def enlarged(*rows):
    """Read an image from text of which each character is a cell of 8 x 8 pixels."""
    return np.kron(pixels(*rows), np.ones((SIDE, SIDE), np.uint8))


CELLS = enlarged("##..", "##.?")


def heat_of(*masks, truth=CELLS):
    heat = HeatMap()
    for mask in masks:
        heat.add(error_map(mask, truth).array)
    return heat


def test_a_heat_map_counts_labels_false_positives_and_negatives_in_each_cell():
    masks = enlarged("#..#", "##.#"), enlarged("#..#", "##..")
    side, sums = heat_of(*masks).cells()
    labelled, fp, fn = (sums / SIDE**2).tolist()
    assert side == SIDE
    assert labelled == [[2, 2, 2, 2], [2, 2, 2, 0]]
    assert fp == [[0, 0, 0, 2], [0, 0, 0, 0]]
    assert fn == [[0, 2, 0, 0], [0, 0, 0, 0]]


@pytest.mark.parametrize(("width", "side"), [(4, 8), (1280, 8), (1281, 9), (1920, 12)])
def test_a_cell_has_eight_pixels_a_side_or_is_one_of_160_across(width, side):
    truth = np.zeros((3, width), np.uint8)
    assert heat_of(truth, truth=truth).cells()[0] == side


def test_a_frame_of_another_size_is_left_out():
    heat = heat_of(enlarged("##..", "##.."))
    heat.add(np.zeros((1, 1), np.uint8))
    assert heat.frames == 1


@pytest.mark.parametrize("frames", [254, 255, 256, 511])
def test_a_sum_that_does_not_fit_in_a_byte_is_carried(frames):
    heat = heat_of(*[enlarged("#..#", "##..")] * frames)
    assert heat.cells()[1][1, 0, 3] == frames * SIDE**2


def test_a_large_map_is_summed_up_in_square_cells_and_loses_nothing():
    truth = np.zeros((201, 322), np.uint8)
    mask = np.random.default_rng(0).integers(0, 2, truth.shape, np.uint8)
    side, cells = heat_of(mask, truth=truth).cells()
    assert (side, cells.shape) == (SIDE, (3, 26, 41))
    assert cells[1, 1, 2] == mask[8:16, 16:24].sum()
    assert cells[1].sum() == mask.sum()
    assert cells[0, 0, 40] == 16


def test_a_large_map_carried_between_bytes_and_cells_loses_nothing():
    truth = np.zeros((160, 200), np.uint8)
    masks = np.random.default_rng(0).integers(0, 2, (5, *truth.shape), np.uint8)
    heat = heat_of(*[mask for mask in masks for _ in range(103)], truth=truth)
    total = 103 * masks.sum(axis=0, dtype=np.int64)
    side, cells = heat.cells()
    assert side == SIDE
    assert cells[1].tolist() == total.reshape(20, 8, 25, 8).sum(axis=(1, 3)).tolist()


def test_changes_are_from_stage_to_stage_and_from_final_mask_to_final_mask():
    good, bad = pixels("##..", "##.."), pixels("#...", "##..")
    masks = [("a", "svm", bad), ("a", "post", good), ("b", "post", bad)]
    assert changes(masks, MAP_TRUTH) == {
        ("a", "svm", "a", "post"): Change(1, 0, 7),
        ("a", "post", "b", "post"): Change(0, 1, 7),
        ("b", "post", "a", "post"): Change(1, 0, 7),
    }


def test_changes_equal_a_plain_loop_over_pixels():
    draw = np.random.default_rng(1)
    truth = draw.choice(np.array([0, 1, IGNORE], np.uint8), (37, 53))
    before, after = draw.integers(0, 2, (2, 37, 53), np.uint8)
    repaired = spoiled = 0
    for t, b, a in zip(truth.flat, before.flat, after.flat, strict=True):
        repaired += t not in (IGNORE, b) and a == t
        spoiled += t not in (IGNORE, a) and b == t
    found = changes([("x", "svm", before), ("x", "post", after)], truth)
    expected = Change(repaired, spoiled, int((truth != IGNORE).sum()))
    assert found == {("x", "svm", "x", "post"): expected}


SECOND = 10**9


def found(seconds, errors, limit=0.15):
    stamps = np.array([round(SECOND * each) for each in seconds], np.int64)
    return episodes(stamps, np.array(errors, float), limit)


def test_an_episode_lasts_from_its_first_frame_to_the_first_one_below_the_limit():
    assert found([0, 0.5, 1, 1.5, 2, 2.5], [0.1, 0.15, 0.3, 0.14, 0.2, 0.0]) == {
        "limit": 0.15,
        "episodes": 2,
        "recovered": 2,
        "seconds": 1.5,
        "share": 1.5 / 2.5,
        "longest": 1.0,
        "recovery": 0.75,
    }


def test_a_frame_whose_rate_is_undefined_says_nothing():
    own = found([0, 1, 2, 3], [0.2, math.nan, 0.2, 0])
    assert (own["episodes"], own["seconds"]) == (1, 3.0)
    none = found([0, 1], [math.nan, math.nan])
    assert (none["episodes"], none["seconds"], none["recovery"]) == (0, 0, None)
    assert math.isnan(none["share"])
    assert str(none) == str(found([], []))


def test_stamps_out_of_order_are_put_in_order():
    assert found([2, 0, 1], [0, 0.2, 0.2]) == found([0, 1, 2], [0.2, 0.2, 0])


@given(st.lists(st.tuples(st.sampled_from([1, 2, 9, 20]), st.booleans()), max_size=30))
def test_equals_a_search_from_each_first_frame(frames):
    """Every frame that begins an episode, and from there to the first that ends it."""
    stamps = np.cumsum([step for step, _ in frames] or [0]) * SECOND // 2
    bad = [is_bad for _, is_bad in frames] or [False]
    steps = np.diff(stamps)
    gap = max(SECOND, 3 * np.median(steps)) if len(steps) else 0
    times, recovered = [], []
    for first in range(len(bad)):
        follows = first > 0 and bad[first - 1] and steps[first - 1] <= gap
        if not bad[first] or follows:
            continue
        last = first
        while last + 1 < len(bad) and steps[last] <= gap and bad[last]:
            last += 1
        times.append(stamps[last] - stamps[first])
        if not bad[last]:
            recovered.append(times[-1])
    own = episodes(stamps, np.where(bad, 0.5, 0.0), 0.15)
    assert (own["episodes"], own["recovered"]) == (len(times), len(recovered))
    assert own["seconds"] == pytest.approx(sum(times) / SECOND)
    if known := sum(steps[steps <= gap]):
        assert own["share"] == pytest.approx(sum(times) / known)
    assert own["longest"] == max(times, default=0) / SECOND
    assert own["recovery"] == (np.median(recovered) / SECOND if recovered else None)
