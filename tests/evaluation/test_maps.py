"""Where pixels go wrong over a drive, what a step changed, and how long a mask errs."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roadeval.data import IGNORE, Change, Packed, TruthBits
from roadeval.evaluation.score import counts
from roadeval.evaluation.score.counts import error_map
from roadeval.evaluation.score.scoreboard import episodes
from roadeval.evaluation.score.thresholds import HeatMap
from tests.evaluation.making import pixels

TRUTH = pixels("##..", "##.?")


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
    assert changes(masks, TRUTH) == {
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
