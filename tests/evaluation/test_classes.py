"""Classes in masks: counted as a plain loop counts them, and summed up with the worst frames."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from roadeval.data import Moment, TruthClass
from roadeval.evaluation.score.classes import BESIDE, ClassSums, count_classes

SHAPE = 9, 13
CLASSES = [TruthClass(3, "road", "road"), TruthClass(4, "", "other"), TruthClass(8, "car", "other")]
TRUTHS = np.array([1, 0, 0, 255], np.uint8)
FRAMES = st.tuples(*(arrays(np.uint8, SHAPE, elements=st.integers(0, n)) for n in (3, 1)))


@given(FRAMES)
def test_pixels_and_road_of_each_class_are_those_of_a_plain_loop(frame):
    codes, mask = frame
    counts = count_classes(codes, TRUTHS[codes], {"mine": mask})["mine"]
    for code in range(4):
        is_class = codes == code
        assert counts[code, :2].tolist() == [is_class.sum(), (is_class & (mask == 1)).sum()]
    assert not counts[4:].any()


def test_missed_road_lies_beside_the_class_of_the_nearest_non_road_if_that_is_near():
    width = 3 * BESIDE
    codes = np.zeros((4, width), np.uint8)
    codes[:, :10], codes[:, -4:] = 1, 2
    mask = np.ones_like(codes)
    mask[:, 10:], mask[:, 10] = 0, 1  # all but the first column of road is missed
    counts = count_classes(codes, TRUTHS[codes], {"mine": mask})["mine"]
    reach = int(math.hypot(4, width) / BESIDE)
    assert counts[:3, 2].tolist() == [0, 4 * (reach - 1), 4 * reach]


def test_ignored_pixels_hide_no_class_and_a_picture_of_road_alone_has_none():
    codes = np.zeros((1, 200), np.uint8)
    codes[0, :2], codes[0, 2] = 1, 3
    counts = count_classes(codes, TRUTHS[codes], {"mine": np.zeros_like(codes)})["mine"]
    assert counts[:4, 2].tolist() == [0, 1, 0, 0]  # the second column of road is too far away
    road = np.zeros((4, 4), np.uint8)
    assert not count_classes(road, TRUTHS[road], {"mine": road})["mine"][:, 2].any()


def counts_of(*rows):
    counts = np.zeros((256, 3), np.int64)
    counts[: len(rows)] = rows
    return {"mine": counts}


def test_rows_sum_up_frames_and_name_the_worst_ones_a_second_apart():
    sums = ClassSums()
    for number, (missed, false) in enumerate([(5, 1), (6, 0), (1, 9), (0, 8), (2, 2)]):
        frame = counts_of((50, 50 - missed, 0), (30, false, 2), (number == 4, 0, 0))
        sums.add(Moment(number, number * 600_000_000), frame)
    assert [*sums.rows(CLASSES)] == [
        ("mine", 3, "road", "road", 250, 236, 0, 5, "1 4"),
        ("mine", 4, "", "other", 150, 20, 10, 5, "2 4 0"),
        ("mine", 8, "car", "other", 1, 0, 0, 1, ""),
    ]


def test_classes_that_say_no_more_than_the_truth_have_no_rows():
    sums = ClassSums()
    sums.add(Moment(0, 0), counts_of((5, 1, 0), (5, 1, 0)))
    assert not [*sums.rows(CLASSES)]
    assert not [*ClassSums().rows(CLASSES)]
