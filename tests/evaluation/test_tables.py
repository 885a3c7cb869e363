"""Totals, windows, pairs, worst frames and causes, by numbers written by hand."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from roadeval.data import Moment, TruthClass
from roadeval.evaluation import tables
from roadeval.evaluation.comparison.compare import compare
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.score.classes import BESIDE, ClassSums, count_classes
from roadeval.evaluation.score.degradation import degradations
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import by_class, only, rates_of
from roadeval.results.comparison import where
from roadeval.results.why import describe_classes
from tests.evaluation.making import a_drive, a_result, a_table, table_of

POST, SVM = ("filtered", "post"), ("filtered", "svm")
CONTROL_POST, CONTROL_SVM = ("unfiltered", "post"), ("unfiltered", "svm")
NOTHING = table_of("frames", [])


def counted(*rows, frames=None, stage="post"):
    """Rows of a mask with these counts: TP, TN, FP and FN."""
    names = ("TP", "TN", "FP", "FN")
    numbers = frames or range(len(rows))
    mask = {"variant": "net", "stage": stage}
    made = [
        {"frame": n, **mask, **dict(zip(names, row, strict=True))}
        for n, row in zip(numbers, rows, strict=True)
    ]
    return table_of("frames", made)


# --- Totals ---------------------------------------------------------------------------------------


def test_totals_sum_counts_average_rates_and_count_the_undefined():
    (row,) = tables.totals(counted((3, 1, 0, 1), (0, 4, 4, 0))).to_dict("records")
    assert row["frames"] == 2
    assert [row[name] for name in ("TP", "TN", "FP", "FN", "N")] == [3, 5, 4, 1, 13]
    assert row["ERR"] == (1 / 5 + 4 / 8) / 2
    assert row["pooled_ERR"] == 5 / 13
    assert row["TPR"] == 0.75  # the second frame has no road
    undefined = {name for name in row if name.startswith("undefined_") and row[name]}
    assert undefined == {"undefined_TPR", "undefined_FNR"}


@pytest.mark.parametrize(
    ("name", "mean", "pooled"),
    [
        ("IoU", (3 / 4 + 1 / 3) / 2, 4 / 7),
        ("mIoU", (5 / 8 + 5 / 12) / 2, (4 / 7 + 7 / 10) / 2),
        ("F1", (6 / 7 + 2 / 4) / 2, 8 / 11),
        ("precision", (1 + 1 / 3) / 2, 4 / 6),
    ],
)
def test_totals_have_overlap_as_mean_of_frames_and_of_all_pixels(name, mean, pooled):
    """A frame without road in mask and truth is in no mean, and counted as undefined."""
    (row,) = tables.totals(counted((3, 1, 0, 1), (0, 4, 0, 0), (1, 2, 2, 0))).to_dict("records")
    assert row[name] == pytest.approx(mean, abs=1e-15)
    assert row[f"pooled_{name}"] == pytest.approx(pooled, abs=1e-15)
    assert row[f"undefined_{name}"] == 1


def test_a_rate_that_no_frame_has_is_undefined():
    (row,) = tables.totals(counted((0, 0, 0, 0))).to_dict("records")
    assert (row["frames"], row["N"], row["undefined_ERR"]) == (1, 0, 1)
    assert math.isnan(row["ERR"])
    assert math.isnan(row["pooled_ERR"])


def test_variants_that_look_like_numbers_keep_their_names_and_order():
    errors = {("10", "post"): [1], ("2", "post"): [3], ("nan", "post"): [5]}
    sums = tables.totals(a_table(errors))
    trees = tables.as_trees(sums)
    rates = [(name, tree["post"]["ERR"]) for name, tree in trees.items()]
    assert rates == [("10", 0.01), ("2", 0.03), ("nan", 0.05)]
    assert tables.masks_of(a_table(errors)) == [*errors]


def test_each_camera_counts_the_same_in_the_mean_of_a_rig():
    front, rear = a_table({POST: [10, 10, 10]}), a_table({POST: [40]}, camera="/rear")
    sums = tables.totals(tables.concatenate([front, rear]), ["camera", "variant", "stage"])
    (row,) = tables.over_cameras(sums).to_dict("records")
    assert (row["ERR"], row["pooled_ERR"], row["frames"]) == (0.25, 0.175, 4)


def test_nothing_evaluated_is_nothing_in_every_table():
    assert tables.as_trees(tables.totals(NOTHING)) == {}
    assert len(tables.windows(NOTHING, 10)) == 0
    names = ["drive", "camera", "window", "first_frame", "last_frame"]
    assert [*tables.windows(NOTHING, 10)][:5] == names
    assert tables.masks_of(NOTHING) == []
    assert tables.is_final(NOTHING).shape == (0,)
    assert len(tables.finals(NOTHING)) == len(tables.worst(NOTHING, 5)) == 0
    assert len(tables.pair_rows(NOTHING, NOTHING, ["drive", "frame"])) == 0
    assert len(tables.changes(NOTHING, *("filtered", "unfiltered"))) == 0
    assert len(tables.causes(NOTHING, "filtered")) == 0
    assert len(tables.concatenate([NOTHING, NOTHING])) == 0
    assert tables.by_region(table_of("regions", [])).empty
    assert [*tables.perfect_stages(table_of("oracles", []), NOTHING)] == []


# --- Windows --------------------------------------------------------------------------------------


def test_the_last_window_may_be_short():
    rows = tables.windows(counted(*[(1, 1, 1, 1)] * 7, frames=range(10, 17)), 3)
    spans = rows[["window", "first_frame", "last_frame", "frames"]].to_numpy().tolist()
    assert spans == [[0, 10, 12, 3], [1, 13, 15, 3], [2, 16, 16, 1]]


def test_a_mask_that_is_missing_on_some_frames_says_how_many_it_has():
    net = counted(*[(1, 1, 1, 1)] * 3, frames=[0, 4, 5])
    whole = a_table({POST: [10] * 7})
    rows = only(tables.windows(tables.concatenate([whole, net]), 2), variant="net")
    assert rows[["window", "first_frame", "last_frame", "frames"]].to_numpy().tolist() == [
        [0, 0, 1, 1],
        [2, 4, 5, 2],
    ]


def test_a_window_has_the_mean_of_the_rates_that_are_defined_and_that_of_all_pixels():
    rows = tables.windows(counted((3, 1, 0, 1), (0, 4, 4, 0), (1, 1, 0, 0)), 2)
    assert rows["ERR"].tolist() == [(1 / 5 + 4 / 8) / 2, 0]
    assert rows["pooled_ERR"].tolist() == [5 / 13, 0]
    assert rows["TPR"].tolist() == [0.75, 1]


def test_each_camera_and_each_drive_is_cut_by_itself():
    parts = [a_table({POST: [10] * 3}), a_table({POST: [20] * 3}, camera="/rear")]
    parts += [a_table({POST: [30] * 2}, drive="road")]
    rows = tables.windows(tables.concatenate(parts), 2)
    groups = tables.group_rows(rows, ["drive", "camera"])
    assert [group["frames"].tolist() for _, group in groups] == [[2, 1], [2, 1], [2]]


def test_windows_go_by_window_and_then_by_mask_in_the_variants_order():
    errors = {SVM: [1] * 3, POST: [1] * 3, CONTROL_POST: [1] * 3}
    rows = tables.windows(a_table(errors), 2)
    masks = [*zip(rows["window"], rows["variant"], rows["stage"], strict=True)]
    assert masks == [(window, *mask) for window in (0, 1) for mask in errors]


# --- Masks and pairs ------------------------------------------------------------------------------


def test_the_final_stage_is_post_or_else_the_last():
    found = tables.finals(
        a_table(
            {SVM: [1], POST: [1], ("mine", "net"): [1], ("mine", "crf"): [1], ("b", "post"): [1]}
        )
    )
    masks = [*zip(found["variant"], found["stage"], strict=True)]
    assert masks == [POST, ("mine", "crf"), ("b", "post")]


def test_each_drive_has_its_own_final_stages():
    drives = [a_table({SVM: [1] * 2}), a_table({SVM: [1], POST: [1]}, drive="road")]
    found = tables.finals(tables.concatenate(drives))
    assert [*zip(found["drive"], found["stage"], strict=True)] == [
        *[("street", "svm")] * 2,
        ("road", "post"),
    ]


def test_changes_are_those_of_the_frames_that_both_have_in_their_order():
    frames = a_table({CONTROL_POST: [10, 10, 10], POST: [12, 9]})
    found = tables.changes(frames, "filtered", "unfiltered")
    assert found["change"].tolist() == pytest.approx([0.02, -0.01])
    assert found["wrong"].tolist() == [2, -1]


def test_parts_of_one_table_that_know_other_words_are_joined():
    whole = tables.concatenate([a_table({POST: [1]}), NOTHING, a_table({("7", "post"): [2]})])
    assert whole["variant"].tolist() == ["filtered", "7"]
    assert whole["variant"].dtype == "category"


# --- Worst frames and causes ----------------------------------------------------------------------


def test_neighbours_are_a_thirtieth_of_the_drive_apart_and_at_most_a_second():
    errors = [40, 50, 45, *[0] * 57, 30]
    short, long = (a_table({POST: errors}, hertz=hertz) for hertz in (10, 0.1))
    assert tables.worst(short, 3)["frame"].tolist() == [1, 60, 3]
    assert tables.worst(long, 3)["frame"].tolist() == [1, 2, 0]


def test_a_frame_without_a_rate_is_none_of_the_worst():
    frames = a_table({POST: [10, 30]}).assign(ERR=[0.1, math.nan])
    assert tables.worst(frames, 5)["frame"].tolist() == [0]
    assert tables.worst(a_table({POST: [7]}), 5)["frame"].tolist() == [0]


@pytest.mark.parametrize(("harmed", "places"), [(True, [2, 1]), (False, [3])])
def test_frames_that_changed_most_are_those_that_changed_at_all(harmed, places):
    stamps = np.arange(4) * 1_000_000_000
    pairs = pd.DataFrame({"stamp_ns": stamps, "change": [0, 0.1, 0.2, -0.1]})
    assert tables.most_changed_frames(pairs, 5, harmed=harmed).index.tolist() == places


def test_the_causes_of_an_error_add_up_to_it():
    frames = a_table({SVM: [30], POST: [12], CONTROL_SVM: [20], CONTROL_POST: [15]})
    filtered = tables.causes(frames, "filtered").loc[0].to_dict()
    assert filtered == pytest.approx({"svm": 0.20, "filter": 0.10, "post": -0.18})
    assert sum(filtered.values()) == pytest.approx(0.12)
    unfiltered = tables.causes(frames, "unfiltered").loc[0].to_dict()
    assert unfiltered == pytest.approx({"svm": 0.20, "post": -0.05})
    alone = tables.causes(a_table({("net", "post"): [7]}), "net")
    assert alone.to_dict("records") == [{"post": 0.07}]


def test_causes_are_undefined_where_a_mask_is_missing():
    frames = a_table({SVM: [30, 20], POST: [12, 10], CONTROL_SVM: [20], CONTROL_POST: [15]})
    found = tables.causes(frames, "filtered")
    assert found["post"].tolist() == pytest.approx([-0.18, -0.10])
    assert found["filter"].isna().tolist() == [False, True]


# --- Regions and perfect stages -------------------------------------------------------------------


def test_regions_pool_the_counts_of_final_masks_and_tell_their_shares():
    def of(region, stage, *counts):
        mask = {"variant": "net", "stage": stage, "region": region, "frame": 0}
        return {**mask, **dict(zip(("TP", "TN", "FP", "FN"), counts, strict=True))}

    rows = [of("boundary", "svm", 0, 0, 9, 9), of("interior", "svm", 0, 0, 9, 9)]
    rows += [of("boundary", "post", 3, 1, 4, 2), of("interior", "post", 20, 8, 1, 1)]
    rows += [of("lit", "post", 4, 4, 1, 1)]
    found = tables.by_region(table_of("regions", rows))
    assert found["ERR"].to_dict() == {
        ("boundary", "net"): 6 / 10,
        ("interior", "net"): 2 / 30,
        ("lit", "net"): 2 / 10,
    }
    assert found["pixels"].tolist() == [10 / 40, 30 / 40, 10 / 40]
    assert found["errors"].tolist() == [6 / 8, 2 / 8, 2 / 8]


def test_a_perfect_stage_is_held_against_the_same_frames_as_they_are():
    frames = a_table({SVM: [30, 30, 30], POST: [12, 10, 50]})
    oracles = a_table({SVM: [6, 4], POST: [2, 4]}).assign(oracle="similarity")
    (found,) = tables.perfect_stages(oracles, frames)
    assert (found["variant"], found["oracle"], found["frames"]) == ("filtered", "similarity", 2)
    assert found["ERR"] == pytest.approx(0.03)
    assert found["as_is"] == pytest.approx(0.11)


@pytest.mark.parametrize(
    ("chains", "order"),
    [
        ([("svm", "post"), ("trees", "post")], ["svm", "trees", "post"]),
        ([("net", "post"), ("svm", "post", "smooth")], ["net", "svm", "post", "smooth"]),
        ([("a", "b"), ("b", "a")], ["a", "b"]),
        ([], []),
    ],
)
def test_stages_of_several_chains_stand_in_the_order_of_each(chains, order):
    assert tables.merge_names(chains) == order


def test_frames_of_a_scene_are_those_near_one_that_ranks_higher():
    random = np.random.default_rng(3)
    for _ in range(100):
        stamps, ranked = random.integers(0, 400, 60), random.permutation(60)
        count, apart, besides = *random.integers(1, 40, 2).tolist(), random.integers(0, 400, 2)
        kept = []
        for place in ranked:
            taken = np.array([*besides, *stamps[kept]])
            if len(kept) < count and (abs(taken - stamps[place]) >= apart).all():
                kept.append(place)
        assert tables.separate(stamps, ranked, count, apart, besides.tolist()).tolist() == kept


# --- How much worse disturbed frames are: paired, by camera, and corrected for their number -------


SETTINGS = EvaluationSettings()


def rows_of_camera(camera: str, wrong: list[int], **columns: str) -> pd.DataFrame:
    """Rows of the variant ``net`` on frames of 1000 pixels, of which so many are wrong."""
    frames = np.arange(len(wrong))
    table = pd.DataFrame({"frame": frames, "stamp_ns": frames * 100_000_000, "FP": wrong})
    table = table.assign(TP=500, TN=500 - table["FP"], FN=0)
    table = table.assign(drive="d", camera=camera, variant="net", stage="post", **columns)
    return table.join(rates_of(table, METRICS))


def test_a_change_is_that_of_the_same_frames_and_the_mean_of_cameras_means():
    wrong = {"front": [10, 20, 30, 40], "rear": [50, 60]}
    frames = pd.concat([rows_of_camera(camera, errors) for camera, errors in wrong.items()])
    # The first frame of the front camera failed under the disturbance.
    disturbed = pd.concat(
        [
            rows_of_camera("front", [10, 120, 130, 140], disturbance="fog:2")[1:],
            rows_of_camera("rear", [70, 80], disturbance="fog:2"),
        ]
    )
    change = degradations(disturbed, frames, SETTINGS)["net"]["fog-2"]
    assert (change.kind, change.strength, change.text) == ("fog", 2, "fog:2")
    assert change.base_ERR == pytest.approx((30 + 55) / 2 / 1000)
    error = change.ERR
    assert error == pytest.approx((130 + 75) / 2 / 1000)
    assert change.difference.mean == pytest.approx(error - change.base_ERR)
    assert (change.difference.units, change.difference.worse) == (5, 5)


def test_changes_are_corrected_for_all_that_are_told_together():
    random = np.random.default_rng(0)
    wrong = random.integers(10, 60, 40)
    frames = rows_of_camera("front", [*wrong])
    disturbed = pd.concat(
        rows_of_camera(
            "front", [*(wrong + random.integers(0, most, 40))], disturbance=f"fog:{most}"
        )
        for most in (2, 4, 8)
    )
    changes = degradations(disturbed, frames, SETTINGS)["net"].values()
    assert [change.difference.comparisons for change in changes] == [3] * 3
    assert all(change.difference.p_holm >= change.difference.p for change in changes)


# --- Classes in masks: counted as a plain loop counts them, and summed up with the worst frames


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
