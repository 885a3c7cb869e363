"""Boundary F of a mask, and what a drive's masks do from frame to frame."""

import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from roadeval.data import IGNORE, FrameResult, Role, TruthBits, pack
from roadeval.evaluation import score
from roadeval.evaluation.region import disk
from roadeval.evaluation.score import EdgesAndFlicker
from tests.evaluation.making import a_frame, a_variant, pixels, unpacked

TRUTH = pixels("##..", "##.?")


def one(mask, truth, width=1):
    packed = TruthBits.of(truth)
    return score.boundary_f({"net": pack(mask)}, packed, width)["net"]


def edge_of(labels):
    return unpacked(score.edge_of(TruthBits.of(labels)), labels.shape[1])


def test_an_edge_is_road_that_touches_non_road_by_side_or_corner():
    labels = pixels("###.", "####", "####")
    assert edge_of(labels).tolist() == [[0, 0, 1, 0], [0, 0, 1, 1], [0, 0, 0, 0]]


def test_neither_the_border_nor_an_ignored_pixel_makes_an_edge():
    assert not edge_of(pixels("##", "##")).any()
    assert not edge_of(pixels("##?.", "##?.")).any()


def test_the_neighbourhood_is_a_disk():
    assert disk(1).tolist() == [1, 0]
    assert disk(5).tolist() == [5, 4, 4, 4, 3, 0]


def test_a_mask_whose_edge_lies_within_the_width_has_1_and_beyond_it_0():
    truth = pixels("##......", "##......")
    near, far = pixels("###.....", "###....."), pixels("####....", "####....")
    assert one(truth, truth) == 1
    assert one(near, truth) == 1
    assert one(far, truth) == 0
    assert one(far, truth, width=2) == 1


def test_by_hand():
    truth = pixels("##......", "##......")
    mask = pixels("##...##.", "##......")
    # Four edge pixels of the mask, two of them near the truth's two: P = 1/2, R = 1.
    assert one(mask, truth) == pytest.approx(2 / 3)


def test_what_the_mask_does_among_ignored_pixels_does_not_count():
    truth = pixels("##..????", "##..????")
    assert one(pixels("##....##", "##...#.#"), truth) == 1


def test_one_edge_alone_gives_0_and_none_at_all_is_undefined():
    truth, empty = pixels("##..", "##.."), pixels("....", "....")
    assert one(empty, truth) == 0
    assert one(truth, empty) == 0
    assert math.isnan(one(empty, empty))


def plain(mask, truth, width):
    """The same by SciPy's exact Euclidean distances, pixel by pixel."""

    def edge(labels):
        found = np.zeros(labels.shape, bool)
        for (row, column), value in np.ndenumerate(labels):
            around = labels[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
            found[row, column] = value == 1 and (around == 0).any()
        return found

    mine, theirs = edge(np.where(truth == IGNORE, IGNORE, mask)), edge(truth)
    precision = (distance_transform_edt(~theirs) <= width)[mine].mean()
    recall = (distance_transform_edt(~mine) <= width)[theirs].mean()
    return 2 * precision * recall / (precision + recall)


@pytest.mark.parametrize("width", [1, 2, 5])
def test_equals_distance_transforms(width):
    draw = np.random.default_rng(width)
    rows = np.arange(60)[:, None]
    truth = (rows > 20 + 6 * np.sin(np.arange(80) / 7)).astype(np.uint8)
    mask = (rows > 22 + 9 * np.sin(np.arange(80) / 6)).astype(np.uint8)
    mask[draw.random(mask.shape) < 0.01] ^= 1
    truth[30:40, 30:50] = IGNORE
    found = one(mask, truth, width)
    assert 0 < found < 1
    assert found == pytest.approx(plain(mask, truth, width), rel=1e-12)


# --- Over a drive


def shown(truth, mask, score=1.0, role=Role.EVALUATED):
    variant = a_variant("net", {"svm": 1 - truth % 2, "post": mask})
    bits = TruthBits.of(truth)
    return FrameResult(a_frame(truth), role, (variant,), truth_bits=bits, contours={"net": score})


def told(*results):
    drive = EdgesAndFlicker(5)
    for result in results:
        drive.add(result)
    return drive.totals()["net"]


def flicker_of(*frames):
    found = told(*(shown(truth, mask) for truth, mask in frames))
    return {name: found[name] for name in ("flicker", "truth_flicker", "pairs")}


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


def test_nothing_is_compared_across_a_change_of_size():
    assert flicker_of((TRUTH, TRUTH), (pixels("#"), pixels("#")))["pairs"] == 0


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


def test_boundary_f_is_averaged_over_the_frames_that_have_one():
    found = told(*(shown(TRUTH, TRUTH % 2, score) for score in (0.5, float("nan"), 1.0)))
    assert found["boundary_F"] == pytest.approx(0.75)
    assert (found["frames"], found["width"], found["pairs"]) == (2, 5, 2)


@pytest.mark.parametrize("role", [Role.TRAINING, Role.GAP, Role.UNLABELLED])
def test_frames_that_are_not_evaluated_are_not_counted_and_interrupt_the_flicker(role):
    one, between = shown(TRUTH, TRUTH % 2), shown(TRUTH, TRUTH % 2, 0.0, role)
    found = told(one, between, one)
    assert (found["boundary_F"], found["pairs"]) == (1, 0)


def test_a_lost_frame_interrupts_the_flicker():
    drive = EdgesAndFlicker(5)
    drive.add(shown(TRUTH, TRUTH % 2))
    drive.interrupt()
    drive.add(shown(TRUTH, TRUTH % 2))
    assert drive.totals()["net"]["pairs"] == 0
