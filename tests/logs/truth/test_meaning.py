"""What the values of a label image mean."""

import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from roadeval.images import Limits
from roadeval.logs import LabelSettings, LogError
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import CompressedPicture
from roadeval.logs.messages.pixels import to_labels
from roadeval.logs.truth.meaning import seen_in, understand
from tests.images.making import file
from tests.logs.making import grey, jpeg, png

LIMITS = Limits()


def truth(values: list[int], labels: LabelSettings | None = None) -> list[int]:
    table = understand(labels or LabelSettings(), values, "/labels")
    return table.of_values(np.array([values], np.uint8))[0].tolist()


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([0, 255], [0, 1]),
        ([0, 128, 255], [0, 255, 1]),
        ([0, 1], [0, 1]),
        ([0, 1, 255], [0, 1, 255]),
        ([0], [0]),
    ],
)
def test_a_mask_is_understood_by_itself(values: list[int], expected: list[int]) -> None:
    assert truth(values) == expected


@pytest.mark.parametrize(("images", "plain"), [(3, True), (2, True), (1, False)])
def test_a_one_in_few_images_of_a_mask_turns_nothing_around(images, plain):
    """Were it road, 255 would be ignored: then one damaged pixel would take all the road away."""
    seen = [0, 255] * 4 + [1] * images
    if plain:
        assert understand(LabelSettings(), seen, "/mask").meaning == {0: 0, 1: 1, 255: 255}
    else:
        with pytest.raises(LogError, match="/mask holds the values 0 1 255: name those"):
            understand(LabelSettings(), seen, "/mask")


def test_class_ids_are_asked_for_with_the_values_seen() -> None:
    with pytest.raises(LogError, match=r"/labels holds the values 0 3 11: .*`labels.road`"):
        truth([0, 3, 11])


def test_given_values_become_road_and_ignore_and_all_others_non_road() -> None:
    labels = LabelSettings(road=(3, 4), ignore=(11,))
    assert truth([0, 3, 4, 11, 255], labels) == [0, 1, 1, 255, 0]


def test_a_sixteen_bit_value_is_understood() -> None:
    table = understand(LabelSettings(road=(300,)), [0, 300], "/labels")
    assert table.of_values(np.array([[0, 300, 44]], np.uint16)).tolist() == [[0, 1, 0]]


@pytest.mark.parametrize(
    ("labels", "setting"),
    [
        (LabelSettings(road=(7,)), "`labels.road` 7"),
        (LabelSettings(road=(3,), ignore=(9,)), "`labels.ignore` 9"),
    ],
)
def test_a_given_value_that_never_occurs_is_refused(labels: LabelSettings, setting: str) -> None:
    with pytest.raises(LogError, match=rf"{setting} does not occur in /labels.* 0 3"):
        truth([0, 3], labels)


def several(values: list[int], labels: LabelSettings) -> list[int]:
    table = understand(labels, values, "/labels", several=True)
    return table.of_values(np.array([values], np.uint8))[0].tolist()


@pytest.mark.parametrize("values", [[0, 255], [0, 128, 255]])
def test_labels_for_several_logs_leave_a_plain_mask_to_be_understood_by_itself(values):
    assert several(values, LabelSettings(road=(3,), ignore=(11,))) == truth(values)


@pytest.mark.parametrize(
    ("values", "road", "ignore"),
    [
        # These may be class ids of a log without the given ones.
        ([0, 1], 3, 11),
        ([0, 1, 255], 3, 11),
        ([0, 128], 3, 11),
        ([0, 3, 255], 7, 11),
        # Here a given value occurs, so that the values are what the settings say.
        ([0, 255], 3, 255),
        ([0, 128, 255], 3, 128),
    ],
)
def test_what_is_not_plainly_a_mask_is_not_guessed_for_several_logs(values, road, ignore):
    labels = LabelSettings(road=(road,), ignore=(ignore,))
    with pytest.raises(LogError, match=r"does not occur .*; say with `drives` what holds"):
        several(values, labels)


def test_given_values_hold_for_a_log_in_which_they_occur_among_several():
    assert several([0, 255], LabelSettings(road=(0,))) == [1, 0]


def test_ignore_needs_road() -> None:
    with pytest.raises(ValueError, match=r"`labels\.ignore` needs `labels\.road`"):
        LabelSettings(ignore=(3,))
    with pytest.raises(ValueError, match=r"`labels\.ignore_colors` needs `labels\.road_colors`"):
        LabelSettings(ignore_colors=(ROAD,))


def test_a_mask_that_later_holds_another_value_is_not_guessed_at() -> None:
    table = understand(LabelSettings(), [0, 255], "/mask")
    with pytest.raises(BadMessage, match="holds the value 7"):
        table.of_values(np.array([[0, 7]], np.uint8))


def colors(*rows: list[tuple[int, int, int]]) -> CompressedPicture:
    return CompressedPicture(0, "png", png(np.array(rows, np.uint8)[..., ::-1]))


def palette_png(indices: list[list[int]], palette: list[int]) -> CompressedPicture:
    image = Image.fromarray(np.array(indices, np.uint8), "P")
    image.putpalette(palette)
    file = io.BytesIO()
    image.save(file, "png")
    return CompressedPicture(0, "png", file.getvalue())


ROAD, LANE, SKY, CAR = (64, 32, 32), (255, 0, 0), (0, 0, 255), (204, 0, 255)


def test_colours_can_mean_road_and_ignore() -> None:
    picture = colors([ROAD, LANE, SKY, CAR])
    labels = LabelSettings(road_colors=(ROAD, LANE), ignore_colors=(CAR,))
    table = understand(labels, seen_in(picture, labels, "/labels", LIMITS), "/labels")
    assert table.read(picture, LIMITS).truth.tolist() == [[1, 1, 0, 255]]
    assert table.words == "road is 64,32,32 255,0,0, 204,0,255 is ignored"


def test_colours_are_asked_for_with_those_seen() -> None:
    with pytest.raises(
        LogError, match=r"/labels holds the colours 0,0,255 64,32,32: .*`labels.road_colors`"
    ):
        seen_in(colors([ROAD, SKY]), LabelSettings(), "/labels", LIMITS)


def test_a_colour_that_never_occurs_is_refused() -> None:
    labels = LabelSettings(road_colors=(LANE,))
    with pytest.raises(LogError, match=r"`labels\.road_colors` 255,0,0 does not occur in /labels"):
        understand(labels, seen_in(colors([ROAD, SKY]), labels, "/labels", LIMITS), "/labels")


def test_values_and_colours_cannot_be_mixed() -> None:
    with pytest.raises(ValueError, match="as values or as colours"):
        LabelSettings(road=(1,), road_colors=(ROAD,))


def test_of_a_palette_the_indices_count_or_its_colours_as_asked() -> None:
    picture = palette_png([[0, 1, 2]], [*SKY, *ROAD, *CAR])
    assert to_labels(picture, LIMITS).tolist() == [[0, 1, 2]]
    labels = LabelSettings(road_colors=(ROAD,))
    table = understand(labels, seen_in(picture, labels, "/labels", LIMITS), "/labels")
    assert table.read(picture, LIMITS).truth.tolist() == [[0, 1, 0]]


def test_a_palette_of_greys_is_a_grey_image() -> None:
    picture = palette_png([[0, 1, 2]], [0, 0, 0, 128, 128, 128, 255, 255, 255])
    assert to_labels(picture, LIMITS).tolist() == [[0, 128, 255]]


def test_three_equal_channels_are_one() -> None:
    assert to_labels(colors([(0, 0, 0), (3, 3, 3)]), LIMITS).tolist() == [[0, 3]]


def fringed(values: list[int], labels: LabelSettings) -> tuple[list[int], int]:
    """Return the truth of an exact image of these values, and how many are fringes."""
    table = understand(labels, values, "/labels")
    picture = CompressedPicture(0, "", png(np.array([values], np.uint8)))
    found = table.read(picture, LIMITS)
    return found.truth[0].tolist(), found.fringe


def test_with_a_tolerance_values_far_from_all_known_ones_are_ignored_and_counted() -> None:
    values = [0, 9, 10, 11, 244, 245, 255]
    found = fringed(values, LabelSettings(tolerance=10))
    assert found == ([0, 0, 0, 255, 255, 1, 1], 2)


def test_a_tolerance_holds_around_the_given_values() -> None:
    labels = LabelSettings(road=(100,), ignore=(200,), tolerance=5)
    assert fringed([3, 6, 95, 106, 198, 255], labels) == ([0, 255, 1, 255, 255, 255], 3)


@pytest.mark.parametrize(
    ("labels", "reason"),
    [
        (LabelSettings(road=(20,), tolerance=10), "10 does not keep 0 and 20 apart"),
        (LabelSettings(road=(90,), tolerance=10), "holds nothing within 10 of 90"),
    ],
)
def test_a_tolerance_that_cannot_be_is_refused(labels: LabelSettings, reason: str) -> None:
    with pytest.raises(LogError, match=reason):
        understand(labels, [0, 20, 255], "/labels")


@pytest.mark.parametrize("given", [{"road": (0,)}, {"road_colors": (ROAD,)}])
def test_a_tolerance_is_for_masks_of_values_in_which_zero_is_non_road(given: Any) -> None:
    with pytest.raises(ValueError, match="in which 0 is non-road"):
        LabelSettings(tolerance=10, **given)


@pytest.mark.parametrize("labels", [LabelSettings(), LabelSettings(road=(255,))])
def test_labels_compressed_with_loss_are_refused_with_the_way_out(labels: LabelSettings) -> None:
    picture = CompressedPicture(0, "jpeg", jpeg(grey(255)))
    with pytest.raises(LogError, match=r"/labels is JPEG, .*PNG, or give `labels\.tolerance`"):
        seen_in(picture, labels, "/labels", LIMITS)
    with pytest.raises(BadMessage, match="a JPEG, whose compression changes label values"):
        understand(labels, [0, 255], "/labels").read(picture, LIMITS)


def test_labels_compressed_with_loss_are_read_with_a_tolerance() -> None:
    mask = 255 * np.tri(32, dtype=np.uint8)
    picture = CompressedPicture(0, "jpeg", file("JPEG", mask, quality=20))
    labels = LabelSettings(tolerance=20)
    table = understand(labels, seen_in(picture, labels, "/labels", LIMITS), "/labels")
    labels = table.read(picture, LIMITS)
    found = labels.truth
    assert 0 < labels.fringe < 200
    assert np.count_nonzero(found == 255) == labels.fringe
    np.testing.assert_array_equal(found == 1, (mask == 255) & (found != 255))
