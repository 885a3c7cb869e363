"""Labels that look wrong: what is planted is named, in its place, and little else."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from roadeval.evaluation.score.label_errors import (
    LabelFlaw,
    LabelledView,
    find_suspects,
    rank_suspects,
)
from roadeval.results.labels import describe_suspects

SIZE = 120, 80
FRAMES = 24
GROUND = np.random.default_rng(0).integers(0, 60, (80, 400), np.uint8)
"""The texture of a scene along which the camera moves."""


def road_at(frame: int) -> np.ndarray:
    """The road, which moves by a column a frame, with the scene."""
    corners = np.array([[70, 25], [80, 25], [118, 80], [20, 80]]) - [frame, 0]
    return cv2.fillPoly(np.zeros(SIZE[::-1], np.uint8), [corners], 1)


def image_at(frame: int) -> np.ndarray:
    """Dark road on a brighter scene."""
    grey = 120 + cv2.GaussianBlur(GROUND, (5, 5), 2)[:, 200 - frame : 320 - frame]
    grey = grey - 70 * road_at(frame)
    return np.repeat(grey[..., None], 3, axis=2)


def method_at(frame: int) -> np.ndarray:
    """A method that always finds road at the upper left, where none is."""
    mask = road_at(frame)
    mask[26:40, 5:20] = 1
    return mask


def wrong_labels() -> dict[int, tuple[LabelFlaw, np.ndarray]]:
    """Labels that are wrong, and what the reason is."""
    cut, specks = road_at(7), road_at(17)
    cut[55:, 70:] = 0
    for x, y in ((50, 60), (62, 70), (66, 48)):
        cv2.circle(specks, (x, y), 2, 0, -1)
    moved = np.roll(road_at(21), 6, axis=0)
    return {
        3: (LabelFlaw.MIRRORED, road_at(3)[:, ::-1]),
        7: (LabelFlaw.JUMP, cut),
        12: (LabelFlaw.ANOTHER_FRAME, road_at(2)),
        17: (LabelFlaw.SPECKS, specks),
        21: (LabelFlaw.MOVED, moved),
    }


def views(*, is_wrong: bool, method: bool = True) -> list[LabelledView]:
    """The labelled frames, with a method or without any."""
    wrong = wrong_labels() if is_wrong else {}
    return [
        LabelledView.of(
            *(frame, frame * 10**9, image_at(frame)),
            np.ascontiguousarray(wrong[frame][1] if frame in wrong else road_at(frame)),
            {"mine": method_at(frame)} if method else {},
        )
        for frame in range(FRAMES)
    ]


@pytest.mark.parametrize("method", [True, False])
def test_wrong_labels_are_named_with_their_reason(method: bool) -> None:
    suspects = rank_suspects(find_suspects(views(is_wrong=True, method=method)), FRAMES, 20)
    reasons = {row.frame: row.reason for row in suspects.itertuples() if row.clear}
    expected = {frame: reason for frame, (reason, _) in wrong_labels().items()}
    assert reasons == expected
    assert describe_suspects(suspects) == "The labels of 5 frames look wrong: 3, 7, 12, 17, 21."
    detail = suspects.set_index("frame")["detail"]
    assert (detail[12], detail[21]) == ("2", "0,6")


def test_the_box_lies_on_the_piece_that_was_cut_off() -> None:
    row = find_suspects(views(is_wrong=True)).set_index("frame").loc[7]
    assert 53 <= row.top <= 57
    assert 68 <= row.left <= 72
    assert row.bottom == SIZE[1]


def test_what_a_method_always_gets_wrong_is_no_sign_against_labels() -> None:
    suspects = rank_suspects(find_suspects(views(is_wrong=False)), FRAMES, 20)
    assert describe_suspects(suspects) == "No label is clearly wrong."


def test_narrow_pictures_have_no_neighbours_to_compare() -> None:
    label = np.ones((20, 320), np.uint8)
    narrow = [
        LabelledView.of(frame, frame, np.zeros((20, 320, 3), np.uint8), label, {})
        for frame in range(3)
    ]
    assert not len(find_suspects(narrow))


def test_one_frame_alone_has_nothing_to_compare() -> None:
    assert not len(rank_suspects(find_suspects(views(is_wrong=True)[3:4]), 1, 20))
