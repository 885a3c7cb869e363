"""What masks are worth beyond counts: their steadiness from frame to frame, and means of edges."""

from dataclasses import replace

import numpy as np
import pytest

from roadeval.data import IGNORE, FrameResult, Packed, Role, TruthBits
from roadeval.evaluation.edges_and_flicker import EdgesAndFlicker, Flicker
from tests.evaluation.making import a_frame, a_variant, pixels

TRUTH = pixels("##..", "##.?")


def flicker_of(*frames):
    flicker = Flicker()
    for truth, mask in frames:
        flicker.add(TruthBits.of(truth), {"net": Packed.of(mask)})
    return flicker.totals("net")


def test_flicker_is_the_share_of_labelled_pixels_that_change_beside_the_truth_s_own():
    moved = pixels("###.", "##.?")
    mask, other = pixels("##..", "##.."), pixels("#...", "##.#")
    assert flicker_of((TRUTH, mask), (moved, other)) == {
        "flicker": 1 / 7,
        "truth_flicker": 1 / 7,
        "pairs": 1,
    }


def test_a_pixel_that_either_truth_ignores_is_not_counted():
    more = pixels("##..", "#?..")
    mask, other = pixels("##..", "##.."), pixels("##..", "#..#")
    assert flicker_of((TRUTH, mask), (more, other))["flicker"] == 0


def test_a_single_frame_has_none():
    assert flicker_of((TRUTH, TRUTH)) == {"flicker": None, "truth_flicker": None, "pairs": 0}


def test_nothing_is_compared_across_an_interruption_or_a_change_of_size():
    flicker = Flicker()
    flicker.add(TruthBits.of(TRUTH), {"net": Packed.of(TRUTH)})
    flicker.interrupt()
    flicker.add(TruthBits.of(TRUTH), {"net": Packed.of(TRUTH)})
    flicker.add(TruthBits.of(pixels("#")), {"net": Packed.of(pixels("#"))})
    assert flicker.totals("net")["pairs"] == 0


def test_equals_a_plain_loop():
    draw = np.random.default_rng(0)
    truths = draw.choice(np.array([0, 1, IGNORE], np.uint8), (4, 9, 11))
    masks = draw.integers(0, 2, (4, 9, 11), np.uint8)
    changed = moved = labelled = 0
    for t in range(1, 4):
        for pixel in np.ndindex(9, 11):
            now, before = truths[t][pixel], truths[t - 1][pixel]
            if IGNORE not in (now, before):
                labelled += 1
                moved += now != before
                changed += masks[t][pixel] != masks[t - 1][pixel]
    assert flicker_of(*zip(truths, masks, strict=True)) == {
        "flicker": changed / labelled,
        "truth_flicker": moved / labelled,
        "pairs": 3,
    }


def a_result(score, number=0, role=Role.EVALUATED):
    variant = a_variant("net", {"svm": 1 - TRUTH % 2, "post": TRUTH % 2})
    frame, truth = a_frame(TRUTH, number), TruthBits.of(TRUTH)
    return FrameResult(frame, role, (variant,), truth_bits=truth, contours={"net": score})


def test_boundary_f_is_averaged_over_the_frames_that_have_one():
    drive = EdgesAndFlicker(5)
    for score in (0.5, float("nan"), 1.0):
        drive.add(a_result(score))
    told = drive.totals()["net"]
    assert told["boundary_F"] == pytest.approx(0.75)
    assert (told["frames"], told["width"], told["pairs"]) == (2, 5, 2)


@pytest.mark.parametrize("role", [Role.TRAINING, Role.GAP, Role.UNLABELLED])
def test_frames_that_are_not_evaluated_are_not_counted_and_interrupt_the_flicker(role):
    drive = EdgesAndFlicker(5)
    for result in (a_result(1.0), replace(a_result(0.0), role=role), a_result(1.0)):
        drive.add(result)
    assert drive.totals()["net"]["boundary_F"] == 1
    assert drive.totals()["net"]["pairs"] == 0


def test_a_lost_frame_interrupts_the_flicker():
    drive = EdgesAndFlicker(5)
    drive.add(a_result(1.0))
    drive.interrupt()
    drive.add(a_result(1.0))
    assert drive.totals()["net"]["pairs"] == 0


def test_flicker_is_of_the_final_mask():
    drive = EdgesAndFlicker(5)
    steady = a_variant("net", {"svm": 1 - TRUTH % 2, "post": TRUTH % 2})
    restless = a_variant("net", {"svm": TRUTH % 2, "post": TRUTH % 2})
    for variant in (steady, restless):
        drive.add(replace(a_result(1.0), variants=(variant,)))
    assert drive.totals()["net"]["flicker"] == 0
