"""Slices that are planted are found, and of errors by chance hardly one is named."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from benchmarks.slices import make_drive, make_fleet, names, plants, walk
from roadeval.data import Role, TruthClass
from roadeval.evaluation.score.conditions import QUANTITIES, blur, curvature
from roadeval.evaluation.score.scoreboard import Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.autocorrelation import mean_distribution
from roadeval.evaluation.stats.slices import FrameCondition, find_slices
from tests.evaluation.making import a_frame, a_variant, pixels


def conditions(seed: int, frames: int = 400) -> pd.DataFrame:
    """Conditions of a made-up drive, each with a memory of its own."""
    rng = np.random.default_rng([9, seed])
    memories = (2, 5, 10, 20, 40, 80, 160)
    pairs = zip(QUANTITIES, memories, strict=True)
    return pd.DataFrame({name: walk(rng, frames, memory) for name, memory in pairs})


REALS = [conditions(seed) for seed in range(6)]
PLANTS = {name: (what, plant) for name, what, plant in plants(3, REALS)}


@pytest.mark.sweep
def test_at_most_one_of_twenty_null_drives_names_a_slice() -> None:
    found = 0
    for seed in range(20):
        rng = np.random.default_rng([1, seed])
        frames, memory = (90, 190, 400)[seed % 3], (1, 5, 20, 50)[seed % 4]
        found += bool(find_slices(*make_drive(rng, conditions(seed), frames, memory), 0.95))
    assert found <= 1


@pytest.mark.sweep
@pytest.mark.parametrize("kind", PLANTS)
def test_a_planted_slice_is_found_with_its_ratio(kind: str) -> None:
    what, plant = PLANTS[kind]
    right = 0
    for seed in range(6):
        drive = make_drive(np.random.default_rng([3, seed]), conditions(seed), 600, 2, plant)
        right += names(find_slices(*drive, 0.95), what)
    assert right >= 4


def test_numbers_are_of_the_confirming_half_and_the_worst_frames_are_apart() -> None:
    drive = make_drive(np.random.default_rng(3), conditions(0), 600, 2, PLANTS["one"][1])
    found = find_slices(*drive, 0.95)[0]
    assert found.low <= 3 <= found.high
    assert found.ratio == pytest.approx(found.inside / found.outside)
    assert 1 < found.low < found.ratio < found.high
    assert 50 < found.frames < 200
    assert len(found.worst) == 3
    assert min(np.diff(sorted(found.worst))) > 1


def test_a_fleet_names_a_planted_slice_with_the_drives_of_its_worst_frames() -> None:
    fleet = make_fleet(np.random.default_rng(5), REALS, 40, PLANTS["one"][1])
    found = find_slices(*fleet, 0.95, over_drives=True)
    assert names(found, "brightness")
    assert len({*found[0].drives}) == 3


def test_a_tag_is_compared_between_drives() -> None:
    frames, of_frames, parts = make_fleet(np.random.default_rng(6), [conditions(0)], 40)
    rain = (of_frames["tag_weather"] == "rain").to_numpy()
    frames.loc[rain, "FP"] *= 4
    found = find_slices(frames, of_frames, parts[:0], 0.95, over_drives=True)
    assert [FrameCondition("tag_weather", "is", "rain")] in [place.conditions for place in found]


@pytest.mark.parametrize("frames", [0, 1, 39])
def test_too_few_frames_name_nothing(frames: int) -> None:
    rows = [table[table["frame"] < frames] for table in make_drive(*_FIRST)]
    assert find_slices(*rows, 0.95) == []


_FIRST = (np.random.default_rng(7), conditions(1), 90, 1, PLANTS["one"][1])


def test_distances_are_united_from_near_to_far_and_replace_rows() -> None:
    frames, of_frames, parts = make_drive(np.random.default_rng(8), conditions(2), 400, 2)
    bands = {"part0": "0-10m", "part1": "10-20m", "part2": "20-40m", "part3": "band_0"}
    parts["region"] = parts["region"].map(bands)
    far = parts["region"].isin(["10-20m", "20-40m"]).to_numpy()
    parts.loc[far, "wrong"] *= 3
    frames["FP"] = parts.groupby("frame")["wrong"].sum().to_numpy()
    found = {place.part for place in find_slices(frames, of_frames, parts, 0.95)}
    assert "10-40m" in found
    assert not any(part.startswith("rows") for part in found)


def test_a_class_is_named_under_a_condition_and_never_alone() -> None:
    frames, of_frames, parts = make_drive(
        np.random.default_rng(9), conditions(0), 600, 2, PLANTS["part"][1]
    )
    parts["region"] = parts["region"].replace("part0", "on car")
    found = [place for place in find_slices(frames, of_frames, parts, 0.95) if place.part]
    assert "on car" in {place.part for place in found}
    assert all(place.conditions for place in found if place.part == "on car")
    parts.loc[parts["region"] == "on car", "wrong"] = 100
    assert all(place.conditions for place in find_slices(frames, of_frames, parts, 0.95))


def test_what_bright_drives_have_in_common_is_no_effect_of_light_within_drives() -> None:
    rng, tables = np.random.default_rng(11), []
    for place, bright in enumerate(rng.permutation(np.linspace(0, 1, 40))):
        real = pd.DataFrame({"brightness": bright + 0.3 * rng.standard_normal(60)})
        drive = f"d{place:02d}"
        made = make_drive(rng, real, 60, 1, name=drive, level=0.03 + 0.09 * bright)
        tables.append((made[0], made[1].assign(group=drive), made[2]))
    frames, of_frames, parts = (
        pd.concat(rows, ignore_index=True) for rows in zip(*tables, strict=True)
    )
    assert find_slices(frames, of_frames, parts[:0], 0.95, over_drives=True) == []


@pytest.mark.parametrize("memory", [1, 20])
def test_the_error_of_a_difference_allows_for_slow_errors_in_slow_conditions(memory: int) -> None:
    rng, frames = np.random.default_rng(12), 200
    halves = np.where(np.arange(frames) < frames // 2, 2, -2) / frames
    series = [walk(rng, frames, memory) for _ in range(80)]
    differences = [halves @ values for values in series]
    errors = [mean_distribution(values, factors=halves).standard_error for values in series]
    assert 0.75 < np.sqrt(np.mean(np.square(errors))) / np.std(differences) < 1.35


# --- What an image and its truth are like, on images that are made by hand ------------------------


TRUTH = pixels("....", "####", "####", "??##")
MASK = pixels("#...", "####", "####", "####")
SHADE = pixels("....", "....", "...#", "####")


def collected(*images: int | None) -> Scoreboard:
    """A scoreboard of frames of one grey each; None is a frame that is lost."""
    board = Scoreboard(("street", "/camera"), EvaluationSettings(bands=2), ["filtered"], None)
    for number, grey in enumerate(images):
        if grey is None:
            board.lose()
            continue
        image = np.full((4, 4, 3), grey, np.uint8)
        frame = replace(a_frame(TRUTH, number), image=image)
        variant = a_variant("filtered", {"post": MASK}, {"shadow": SHADE})
        board.add(board.score(frame, Role.EVALUATED, (variant,)))
    return board


def test_light_shade_and_road_are_shares() -> None:
    row = collected(51).conditions.table().iloc[0]
    assert row["brightness"] == pytest.approx(0.2)
    assert row["contrast"] == 0
    assert row["shadow"] == pytest.approx(3 / 14, abs=1e-5)  # ignored pixels are in no count
    assert row["road_share"] == pytest.approx(10 / 14, abs=1e-5)


def test_a_change_is_from_the_frame_before_unless_that_was_lost() -> None:
    changes = collected(0, 51, None, 102, 102).conditions.table()["change"]
    assert [*changes] == pytest.approx([np.nan, 0.2, np.nan, 0.0], nan_ok=True)


def test_each_part_of_a_frame_has_its_wrong_and_labelled_pixels() -> None:
    parts = collected(0).conditions.parts().set_index("region")[["frame", "wrong", "N"]]
    assert parts.loc["left"].tolist() == [0, 1, 6]
    assert parts.loc["right"].tolist() == [0, 0, 8]
    assert parts.loc["band_0"].tolist() == [0, 1, 8]


def test_each_class_but_the_ignored_one_is_a_part() -> None:
    board = Scoreboard(("street", "/camera"), EvaluationSettings(bands=2), ["filtered"], None)
    codes = np.where(TRUTH == 0, np.arange(4) % 2, np.where(TRUTH == 1, 2, 3)).astype(np.uint8)
    frame = replace(a_frame(TRUTH, 0), classes=codes)
    board.add(board.score(frame, Role.EVALUATED, (a_variant("filtered", {"post": MASK}),)))
    classes = [
        TruthClass(5, "verge", "other"),
        TruthClass(6, "", "other"),
        TruthClass(7, "road", "road"),
        TruthClass(8, "void", "ignored"),
    ]
    parts = board.conditions.parts(classes).set_index("region")[["frame", "wrong", "N"]]
    rows = {name: parts.loc[name].tolist() for name in parts.index if name.startswith("on ")}
    assert rows == {"on verge": [0, 1, 2], "on class 6": [0, 0, 2], "on road": [0, 0, 10]}


def test_a_scoreboard_without_frames_has_no_conditions() -> None:
    assert list(collected().conditions.table()) == ["frame", "stamp_ns", *QUANTITIES]


def test_a_smooth_image_is_more_blurred_than_a_noisy_one() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (32, 64, 3), np.uint8)
    ramp = np.broadcast_to(np.arange(64, dtype=np.uint8)[None, :, None], (32, 64, 3))
    assert blur(ramp) == pytest.approx(0.75)
    assert abs(blur(noise)) < 0.1


@pytest.mark.parametrize(("bend", "expected"), [(0, 0), (8, 8 / 64)])
def test_a_slanted_road_is_straight_and_a_bent_one_is_not(bend: int, expected: float) -> None:
    truth = np.zeros((30, 64), np.uint8)
    for row in range(30):
        middle = 20 + row // 2 + bend * (10 <= row < 20)
        truth[row, middle - 3 : middle + 4] = 1
    assert curvature(truth) == pytest.approx(expected, abs=0.01)


def test_a_road_in_few_rows_has_no_curvature() -> None:
    assert np.isnan(curvature(TRUTH))
