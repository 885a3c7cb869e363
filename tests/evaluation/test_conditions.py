"""What an image and its truth are like, on images that are made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from roadeval.data import Role, TruthClass
from roadeval.evaluation.score.conditions import QUANTITIES, blur, curvature
from roadeval.evaluation.score.scoreboard import Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from tests.evaluation.making import a_frame, a_variant, pixels

TRUTH = pixels("....", "####", "####", "??##")
MASK = pixels("##..", "####", "####", "####")
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
    parts = collected(0).conditions.parts("filtered").set_index("region")
    assert parts.loc["left"].tolist() == [0, 2, 6]
    assert parts.loc["right"].tolist() == [0, 0, 8]
    assert parts.loc["band_0"].tolist() == [0, 2, 8]


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
    parts = board.conditions.parts("filtered", classes).set_index("region")
    rows = {name: parts.loc[name].tolist() for name in parts.index if name.startswith("on ")}
    assert rows == {"on verge": [0, 1, 2], "on class 6": [0, 1, 2], "on road": [0, 0, 10]}


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
