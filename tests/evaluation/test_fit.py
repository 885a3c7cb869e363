"""Truth and masks that do not belong to the images are found, and others are left alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
import pytest

from roadeval.data import Frame, Packed
from roadeval.evaluation.score.fit import TRUTH, Finding, FitCheck, Misfit
from roadeval.evaluation.score.label_errors import (
    LabelFlaw,
    LabelledView,
    find_suspects,
    rank_suspects,
)
from roadeval.results.sentences import describe_suspects

FRAMES = 40
HEIGHT, WIDTH = 120, 160
Masks = Sequence[np.ndarray]


def road_at(moment: float) -> np.ndarray:
    """A road that bends and sways: its far end wanders, its near end follows."""
    rows = np.arange(HEIGHT)[:, None]
    depth = np.clip((rows - 45) / (HEIGHT - 45), 0, 1)
    far = 95 + 22 * np.sin(moment / 3)
    centre = far + (70 + 8 * np.cos(moment / 5) - far) * depth
    half = 6 + 50 * depth
    columns = np.arange(WIDTH)
    return ((rows >= 45) & (abs(columns - centre) <= half)).astype(np.uint8)


def image_of(road: np.ndarray, seed: int) -> np.ndarray:
    """The road on grass below a sky, with noise."""
    grey = np.where(road, 90, 150) + np.where(np.arange(HEIGHT)[:, None] < 40, 60, 0)
    noise = np.random.default_rng(seed).normal(0, 8, grey.shape)
    return np.repeat(np.clip(grey + noise, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


ROADS = [road_at(moment) for moment in range(FRAMES)]
IMAGES = [image_of(road, seed) for seed, road in enumerate(ROADS)]


def late(masks: Masks, frames: int) -> Masks:
    return [masks[min(max(place - frames, 0), len(masks) - 1)] for place in range(len(masks))]


def moved(masks: Masks, right: int, down: int) -> Masks:
    return [np.roll(mask, (down, right), (0, 1)) for mask in masks]


def rough(masks: Masks, *, grow: int = 0, holes: float = 0.0) -> Masks:
    """Masks as a method makes them: grown or shrunk all around, with parts that it misses."""
    import cv2

    block = np.ones((2 * abs(grow) + 1,) * 2, np.uint8)
    change = cv2.dilate if grow > 0 else cv2.erode
    noise = np.random.default_rng(1)
    missed = (noise.random((len(masks), 15, 20)) >= holes).astype(np.uint8)
    return [
        change(mask, block) & np.kron(keep, np.ones((8, 8), np.uint8))
        for mask, keep in zip(masks, missed, strict=True)
    ]


def found(
    truth: Masks | None, images: Masks = IMAGES, computed: Masks | None = None, **external: Masks
) -> list[Finding]:
    check = FitCheck(range(len(images)))
    for number, image in enumerate(images):
        frame = Frame(
            *(number, number * 10**8, number * 10**8, image, b""),
            truth=None if truth is None else truth[number],
            external={name: masks[number] for name, masks in external.items()},
        )
        check.add(frame, [] if computed is None else [Packed.of(computed[number])])
    return list(check.findings())


WRONG: dict[str, tuple[Callable[[Masks], Masks], Finding]] = {
    **{
        f"{frames} late": (
            lambda masks, frames=frames: late(masks, frames),
            Finding("", Misfit.LAG, frames=frames),
        )
        for frames in (1, 2, 3, 5, -1, -4)
    },
    "mirrored": (lambda masks: [mask[:, ::-1] for mask in masks], Finding("", Misfit.MIRRORED)),
    "upside down": (lambda masks: [mask[::-1] for mask in masks], Finding("", Misfit.UPSIDE_DOWN)),
    "inverted": (lambda masks: [1 - mask for mask in masks], Finding("", Misfit.INVERTED)),
}
MOVES = [(3, 0), (-4, 0), (0, 5), (0, -3), (8, -6), (0, 12)]


@pytest.mark.parametrize(
    ("name", "method"),
    [*((name, "exact") for name in WRONG), ("2 late", "holes"), ("mirrored", "holes")],
)
def test_masks_that_do_not_fit_are_named(name: str, method: str) -> None:
    change, finding = WRONG[name]
    masks = rough(ROADS, holes=0.1) if method == "holes" else ROADS
    kind = found(ROADS, mine=change(masks))
    assert kind == [Finding("mine", finding.misfit, finding.frames)]


@pytest.mark.parametrize("name", WRONG)
def test_truth_that_does_not_fit_is_named_by_the_images_alone(name: str) -> None:
    change, finding = WRONG[name]
    assert found(change(ROADS)) == [Finding(TRUTH, finding.misfit, finding.frames)]


def test_truth_that_is_late_is_named_once_beside_masks_that_fit_the_images() -> None:
    assert found(late(ROADS, 2), mine=ROADS) == [Finding(TRUTH, Misfit.LAG, frames=2)]


def test_masks_computed_here_tell_that_truth_is_late_where_the_image_has_no_edge() -> None:
    blank = [np.full((HEIGHT, WIDTH, 3), 99, np.uint8)] * FRAMES
    assert found(late(ROADS, 2), blank, ROADS) == [Finding(TRUTH, Misfit.LAG, frames=2)]


@pytest.mark.parametrize(
    ("right", "down", "holes"), [*((*move, 0.1) for move in MOVES), (3, 0, 0.0), (0, 12, 0.0)]
)
def test_moved_masks_are_named_with_their_pixels(right: int, down: int, holes: float) -> None:
    (finding,) = found(ROADS, mine=moved(rough(ROADS, holes=holes), right, down))
    assert finding.misfit is Misfit.MOVED
    assert abs(finding.right - right) <= 1
    assert abs(finding.down - down) <= 1


@pytest.mark.parametrize("grow", [-4, 2])
@pytest.mark.parametrize(("right", "down"), [(0, 0), (4, 0), (0, -6), (-8, 6)])
def test_masks_that_are_grown_and_moved_are_named_with_the_move_or_left_alone(
    grow: int, right: int, down: int
) -> None:
    for finding in found(ROADS, mine=moved(rough(ROADS, grow=grow, holes=0.1), right, down)):
        assert finding.misfit is Misfit.MOVED
        assert abs(finding.right - right) <= 2
        assert abs(finding.down - down) <= 2


@pytest.mark.parametrize(
    "masks",
    [
        ROADS,
        rough(ROADS, grow=4),
        rough(ROADS, grow=-4),
        rough(ROADS, holes=0.5),
        moved(ROADS, 1, 1),
        [np.zeros((HEIGHT, WIDTH), np.uint8)] * FRAMES,
        [np.ones((HEIGHT, WIDTH), np.uint8)] * FRAMES,
        list((np.random.default_rng(3).random((FRAMES, HEIGHT, WIDTH)) < 0.5).astype(np.uint8)),
    ],
    ids=["right", "wide", "narrow", "holes", "a pixel off", "nowhere", "everywhere", "noise"],
)
def test_masks_that_are_merely_bad_are_left_alone(masks: Masks) -> None:
    assert found(ROADS, mine=masks) == []


def test_a_standing_vehicle_is_left_alone() -> None:
    road = road_at(2.0)
    images = [image_of(road, seed) for seed in range(FRAMES)]
    assert found([road] * FRAMES, images, mine=[road] * FRAMES) == []


def test_a_bad_method_before_a_standing_vehicle_is_not_called_moved() -> None:
    road = road_at(2.0)
    images = [image_of(road, seed) for seed in range(FRAMES)]
    bad = rough([np.roll(road, (4, 6), (0, 1))] * FRAMES, holes=0.2)
    assert found([road] * FRAMES, images, mine=bad) == []


def shaken(masks: Masks) -> Masks:
    """Masks that lie some 7 pixels off, in each frame another way."""
    ways = np.random.default_rng(0).normal(0, 7, (len(masks), 2)).round().astype(int)
    return [np.roll(mask, way, (0, 1)) for mask, way in zip(masks, ways, strict=True)]


UNTOUCHED: dict[str, Callable[[Masks], Masks]] = {
    "exact": lambda roads: roads,
    "wide": lambda roads: rough(roads, grow=3),
    "narrow with holes": lambda roads: rough(roads, grow=-3, holes=0.2),
    "shaken": shaken,
}


@pytest.mark.parametrize("method", [*UNTOUCHED, "off"])
def test_a_straight_empty_road_is_left_alone(method: str) -> None:
    roads = [road_at(0.0)] * FRAMES
    dashes = [(np.arange(HEIGHT)[:, None] + 9 * n) % 24 < 12 for n in range(FRAMES)]
    centre = abs(np.arange(WIDTH) - 80) <= 2
    images = [
        np.where((road * dash * centre)[..., None] > 0, np.uint8(240), image_of(road, seed))
        for seed, (road, dash) in enumerate(zip(roads, dashes, strict=True))
    ]
    masks = moved(rough(roads, holes=0.2), 6, 4) if method == "off" else UNTOUCHED[method](roads)
    assert found(roads, images, roads, mine=masks) == []


@pytest.mark.parametrize("method", UNTOUCHED)
def test_a_drive_of_a_frame_a_second_is_left_alone(method: str) -> None:
    roads = [road_at(15.0 * second) for second in range(FRAMES)]
    images = [image_of(road, seed) for seed, road in enumerate(roads)]
    assert found(roads, images, roads, mine=UNTOUCHED[method](roads)) == []


def test_few_frames_say_nothing() -> None:
    assert found(late(ROADS, 3)[:5], IMAGES[:5], mine=ROADS[:5]) == []


def test_small_images_and_masks_of_another_size_are_left_alone() -> None:
    small = [image[::4, ::4] for image in IMAGES]
    assert found(None, small, mine=[road[::-4, ::4] for road in ROADS]) == []
    assert found(ROADS, mine=[road[::2, ::-2] for road in ROADS]) == []


def test_images_of_another_size_than_the_first_are_left_out() -> None:
    halves = [image[::2, ::2] if number % 2 else image for number, image in enumerate(IMAGES)]
    truth = [road[::2, ::2] if number % 2 else road for number, road in enumerate(ROADS)]
    assert found(truth, halves) == []


def test_pixels_of_a_wide_image_are_its_own() -> None:
    wide = [np.kron(image, np.ones((8, 8, 1), np.uint8)) for image in IMAGES]
    truth = [np.kron(road, np.ones((8, 8), np.uint8)) for road in ROADS]
    (finding,) = found(truth, wide, mine=moved(truth, 12, 0))
    assert abs(finding.right - 12) <= 2


def test_labels_of_few_frames_are_held_against_each_image_around() -> None:
    labelled = [road if number % 4 == 1 else None for number, road in enumerate(late(ROADS, 2))]
    assert found(labelled) == [Finding(TRUTH, Misfit.LAG, frames=2)]  # type: ignore[arg-type]


# --- Labels that look wrong: what is planted is named, in its place, and little else --------------


SIZE = 120, 80
LABELS = 24
GROUND = np.random.default_rng(0).integers(0, 60, (80, 400), np.uint8)
"""The texture of a scene along which the camera moves."""


def road_ahead(frame: int) -> np.ndarray:
    """The road, which moves by a column a frame, with the scene."""
    corners = np.array([[70, 25], [80, 25], [118, 80], [20, 80]]) - [frame, 0]
    return cv2.fillPoly(np.zeros(SIZE[::-1], np.uint8), [corners], 1)


def image_at(frame: int) -> np.ndarray:
    """Dark road on a brighter scene."""
    grey = 120 + cv2.GaussianBlur(GROUND, (5, 5), 2)[:, 200 - frame : 320 - frame]
    grey = grey - 70 * road_ahead(frame)
    return np.repeat(grey[..., None], 3, axis=2)


def method_at(frame: int) -> np.ndarray:
    """A method that always finds road at the upper left, where none is."""
    mask = road_ahead(frame)
    mask[26:40, 5:20] = 1
    return mask


def wrong_labels() -> dict[int, tuple[LabelFlaw, np.ndarray]]:
    """Labels that are wrong, and what the reason is."""
    cut, specks = road_ahead(7), road_ahead(17)
    cut[55:, 70:] = 0
    for x, y in ((50, 60), (62, 70), (66, 48)):
        cv2.circle(specks, (x, y), 2, 0, -1)
    moved = np.roll(road_ahead(21), 6, axis=0)
    return {
        3: (LabelFlaw.MIRRORED, road_ahead(3)[:, ::-1]),
        7: (LabelFlaw.JUMP, cut),
        12: (LabelFlaw.ANOTHER_FRAME, road_ahead(2)),
        17: (LabelFlaw.SPECKS, specks),
        21: (LabelFlaw.MOVED, moved),
    }


def views(*, is_wrong: bool, method: bool = True) -> list[LabelledView]:
    """The labelled frames, with a method or without any."""
    wrong = wrong_labels() if is_wrong else {}
    return [
        LabelledView.of(
            *(frame, frame * 10**9, image_at(frame)),
            np.ascontiguousarray(wrong[frame][1] if frame in wrong else road_ahead(frame)),
            {"mine": method_at(frame)} if method else {},
        )
        for frame in range(LABELS)
    ]


@pytest.mark.parametrize("method", [True, False])
def test_wrong_labels_are_named_with_their_reason(method: bool) -> None:
    suspects = rank_suspects(find_suspects(views(is_wrong=True, method=method)), LABELS, 20)
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
    suspects = rank_suspects(find_suspects(views(is_wrong=False)), LABELS, 20)
    assert describe_suspects(suspects) == "No label is clearly wrong."


def test_a_label_like_those_beside_it_is_not_of_another_frame() -> None:
    """The road stays, other things do not, and the method fails on one frame."""
    failed, noise = np.zeros(SIZE[::-1], np.uint8), np.random.default_rng(0)
    still = [
        LabelledView.of(
            *(frame, frame * 10**9, noise.integers(0, 256, (*SIZE[::-1], 3), np.uint8)),
            road_ahead(0),
            {"mine": failed if frame == 9 else road_ahead(0)},
        )
        for frame in range(LABELS)
    ]
    suspects = find_suspects(still)
    assert (suspects["frame"].tolist(), suspects["reason"].tolist()) == ([9], [LabelFlaw.METHODS])


def test_narrow_pictures_have_no_neighbours_to_compare() -> None:
    label = np.ones((20, 320), np.uint8)
    narrow = [
        LabelledView.of(frame, frame, np.zeros((20, 320, 3), np.uint8), label, {})
        for frame in range(3)
    ]
    assert not len(find_suspects(narrow))


def test_one_frame_alone_has_nothing_to_compare() -> None:
    assert not len(rank_suspects(find_suspects(views(is_wrong=True)[3:4]), 1, 20))
