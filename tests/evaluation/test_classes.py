"""Classes in masks: counted as a plain loop counts them, and summed up with the worst frames."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from roadeval.data import Moment, TruthClass
from roadeval.evaluation.comparison.compare import compare
from roadeval.evaluation.score.classes import BESIDE, ClassSums, count_classes
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import by_class
from roadeval.results.comparison import where
from roadeval.results.why import describe_classes
from tests.evaluation.making import a_drive, a_result, table_of

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


def classes_of(variant, *rows, names=("road", "verge", "car")):
    """Rows of ``classes``: value, pixels, pixels called road, and missed road beside it."""
    columns = ("class", "pixels", "road", "beside")
    return [
        dict(zip(columns, row, strict=True))
        | {"variant": variant, "name": name, "truth": "road" if row[0] == 3 else "other"}
        | {"frames": 1, "worst": ""}
        for row, name in zip(rows, names, strict=False)
    ]


def test_shares_of_classes_are_means_over_drives_and_a_class_without_a_name_has_its_number():
    rows = [
        *classes_of("mine", (3, 100, 80, 0), (4, 60, 30, 5), (8, 40, 10, 10)),
        *[
            row | {"drive": "lane"}
            for row in classes_of("mine", (3, 50, 50, 0), (4, 50, 8, 0), names=("road", ""))
        ],
    ]
    shares = by_class(table_of("classes", rows))
    assert shares["false"].to_dict() == {"class 4": 0.5, "verge": 0.375, "car": 0.125, "road": 0}
    assert shares["missed"].to_dict() == {"class 4": 0, "verge": 0.25, "car": 0.5, "road": 0}
    assert shares["road"].to_dict() == {"class 4": 0.16, "verge": 0.5, "car": 0.25, "road": 0.9}


def test_a_sentence_says_which_class_the_errors_are_if_there_are_any():
    rows = classes_of("mine", (3, 9000, 8000, 0), (4, 9000, 69, 500), (8, 9000, 31, 20))
    assert [*describe_classes(table_of("classes", rows), "mine").values()] == [
        "69 % of the false road is verge, 31 % car.",
        "50 % of the missed road lies beside verge.",
    ]
    few = classes_of("mine", (3, 9000, 8990, 0), (4, 90000, 69, 5))
    assert not describe_classes(table_of("classes", few), "mine")


def test_classes_are_compared_by_their_share_even_if_one_result_lacks_their_names():
    parts = ((3, 100, 80, 0), (4, 60, 30, 5), (8, 40, 10, 10)), ((3, 100, 80, 0), (4, 60, 6, 5))
    base, new, same = (
        a_result(
            label,
            a_drive(
                {("filtered", "post"): [10, 20]},
                tables={"classes": table_of("classes", classes_of("filtered", *rows, names=names))},
            ),
        )
        for label, rows, names in (
            ("base", parts[0], ("road", "verge", "car")),
            ("new", parts[1], ("", "")),
            ("same", parts[0], ("", "", "")),
        )
    )
    comparison = compare([base, new, same], EvaluationSettings())
    said = "filtered of new: the false road is 100 % verge (75 % in base), 0 % car (25 % in base)"
    assert said in where(comparison)
    assert [tuple(change) for change in comparison.classes] == [
        ("new", "filtered", "verge", 0.75, 1.0),
        ("new", "filtered", "car", 0.25, 0.0),
    ]
