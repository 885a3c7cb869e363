"""The meaning of the values of a label image."""

import io
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from PIL import Image

from roadeval.images.formats import Limits
from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.messages.pictures import CompressedPicture
from roadeval.logs.messages.pixels import to_labels
from roadeval.logs.settings import LabelSettings, MaskSettings
from roadeval.logs.truth.label_files import file_label
from roadeval.logs.truth.meaning import count_values, find_meaning, meaning_of
from roadeval.logs.truth.named_labels import LabelSet, find_keys
from tests.logs.making import grey, jpeg, png

LIMITS = Limits()


def truth(values: list[int], labels: LabelSettings | None = None) -> list[int]:
    table = find_meaning(labels or LabelSettings(), [values], "/labels")
    return table.of_values(np.array([values], np.uint8))[0].tolist()


@pytest.mark.parametrize(
    ("values", "expected", "labels"),
    [
        ([0, 255], [0, 1], {}),
        ([0, 128, 255], [0, 255, 1], {}),
        ([0, 1], [0, 1], {}),
        ([0, 1, 255], [0, 1, 255], {}),
        ([0], [0], {}),
        ([0, 3, 4, 11, 255], [0, 1, 1, 255, 0], {"road": (3, 4), "ignore": (11,)}),
    ],
)
def test_a_mask_is_understood_by_itself_and_other_values_as_they_are_named(
    values, expected, labels
) -> None:
    assert truth(values, LabelSettings(**labels)) == expected


@pytest.mark.parametrize(
    "pictures",
    [[{0, 1}, {0, 255}], [{0, 255}] * 3 + [{0, 1, 255}], [{0, 1, 255}] * 9 + [{0, 255}]],
)
def test_values_that_mean_road_in_some_pictures_and_ignored_in_others_are_asked_for(pictures):
    """Two annotators' labels in one folder: 255 would be ignored in half of them."""
    with pytest.raises(LogError, match=r"/mask holds the values 0 1 255; 255 is road in masks of"):
        find_meaning(LabelSettings(), pictures, "/mask")
    meaning = find_meaning(LabelSettings(road=(1, 255)), pictures, "/mask")
    assert meaning.of_values(np.array([[0, 1, 255]], np.uint8)).tolist() == [[0, 1, 1]]


@pytest.mark.parametrize(
    ("values", "other", "problem"),
    [
        ({0, 1}, [0, 255], "it holds 255 but no 1; 255 is road in masks of 0 and"),
        ({0, 255}, [0, 7], "holds the value 7"),
    ],
)
def test_a_picture_whose_values_mean_something_else_than_those_looked_at_is_no_label(
    values, other, problem
):
    table = find_meaning(LabelSettings(), [values], "/mask")
    with pytest.raises(BadMessage, match=problem):
        table.of_values(np.array([other], np.uint8))
    assert table.of_values(np.array([[*values]], np.uint8)).tolist() == [[0, 1]]


@pytest.mark.parametrize(
    ("labels", "setting", "problem"),
    [
        (LabelSettings(), "", r"/labels holds the values 0 3 11; .*`labels.road`"),
        (LabelSettings(road=("sky",)), "labels.road", "sky does not occur in /labels"),
        (LabelSettings(road=(3,), ignore=("sky",)), "labels.ignore", "sky does not occur in"),
        (LabelSettings(road=(7,)), "labels.road", r"7 does not occur in /labels.* 0 3 11"),
        (LabelSettings(road=(3,), ignore=(9,)), "labels.ignore", "9 does not occur in /labels"),
    ],
)
def test_a_value_that_is_not_named_or_does_not_occur_is_refused(labels, setting, problem) -> None:
    with pytest.raises(LogError, match=problem) as refused:
        truth([0, 3, 11], labels)
    assert refused.value.setting == setting


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"ignore": (3,)}, "`ignore`: needs `road`"),
        ({"ignore_colors": ((1, 2, 3),)}, "`ignore_colors`: needs `road_colors`"),
        ({"road": (1,), "road_colors": ((1, 2, 3),)}, "as values or as colours"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(settings, problem) -> None:
    with pytest.raises(ValueError, match=problem):
        LabelSettings(**settings)


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
    table = find_meaning(labels, [count_values(picture, labels, "/labels", LIMITS)], "/labels")
    assert table.read(picture, LIMITS).truth.tolist() == [[1, 1, 0, 255]]
    assert table.words == "road is 64,32,32 255,0,0, 204,0,255 is ignored"


def test_colours_are_asked_for_with_those_seen() -> None:
    with pytest.raises(
        LogError, match=r"/labels holds the colours 0,0,255 64,32,32; .*`labels.road_colors`"
    ):
        count_values(colors([ROAD, SKY]), LabelSettings(), "/labels", LIMITS)


def test_of_a_palette_the_indices_count_or_its_colours_as_asked() -> None:
    picture = palette_png([[0, 1, 2]], [*SKY, *ROAD, *CAR])
    assert to_labels(picture, LIMITS).tolist() == [[0, 1, 2]]
    labels = LabelSettings(road_colors=(ROAD,))
    table = find_meaning(labels, [count_values(picture, labels, "/labels", LIMITS)], "/labels")
    assert table.read(picture, LIMITS).truth.tolist() == [[0, 1, 0]]


@pytest.mark.parametrize("labels", [LabelSettings(), LabelSettings(road=(255,))])
def test_labels_compressed_with_loss_are_refused_with_the_way_out(labels: LabelSettings) -> None:
    picture = CompressedPicture(0, "jpeg", jpeg(grey(255)))
    with pytest.raises(LogError, match=r"/labels is JPEG, .*: log labels as PNG"):
        count_values(picture, labels, "/labels", LIMITS)
    with pytest.raises(BadMessage, match="a JPEG, whose compression changes label values"):
        find_meaning(labels, [[0, 255]], "/labels").read(picture, LIMITS)


def test_masks_saved_as_jpeg_are_refused_with_a_command_that_mends_the_folder(tmp_path):
    mask = np.zeros((64, 64), np.uint8)
    mask[20:, 11:53] = 255
    folder = tmp_path / "it's $(touch here)" / "below"
    folder.mkdir(parents=True)
    (folder / "7.jpg").write_bytes(jpeg(np.dstack([mask] * 3)))
    picture = CompressedPicture(0, "jpeg", (folder / "7.jpg").read_bytes())
    with pytest.raises(LogError, match="blurs their edges; make a new folder: ") as caught:
        count_values(picture, LabelSettings(), str(folder.parent), LIMITS, folder / "7.jpg")
    command = str(caught.value).partition("folder: ")[2].replace("python", sys.executable, 1)
    subprocess.run(["bash", "-c", command], check=True, cwd=tmp_path)
    mended = CompressedPicture(0, "png", (tmp_path / "png" / "7.png").read_bytes())
    np.testing.assert_array_equal(to_labels(mended, LIMITS), mask)
    assert not (tmp_path / "here").exists()


@pytest.mark.parametrize("colours", [(255, 0, 255), (7, 7, 7), (11, 7, 3)])
def test_classes_saved_as_jpeg_are_no_masks_to_mend(tmp_path, colours):
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[20:] = colours
    picture = CompressedPicture(0, "jpeg", jpeg(pixels))
    with pytest.raises(LogError) as caught:
        count_values(picture, LabelSettings(), str(tmp_path), LIMITS, tmp_path / "7.jpg")
    assert "make a new folder" not in str(caught.value)


@pytest.mark.parametrize("road", [(7,), ("fence",)])
def test_road_that_covers_hardly_any_pixel_is_told_with_the_classes(tmp_path, road):
    pixels = np.full((20, 20), 3, np.uint8)
    pixels[0, :2] = 7
    cv2.imwrite(str(tmp_path / "0.png"), pixels)
    origin = LabelSet((file_label(tmp_path / "0.png"),))
    if road == ("fence",):
        classes = {"fence": 7, "road": 3}
        origin = replace(origin, classes=classes, occurring={"fence": 1, "road": 1})
    place = MaskSettings(str(tmp_path), labels=LabelSettings(road=road))
    (note,) = meaning_of(find_keys(origin, str(tmp_path), place, LIMITS), place).notes
    names = "3 (99.5 %), 7 (0.5 %)" if road == (7,) else "road (99.5 %), fence (0.5 %)"
    assert note.startswith("road is 0.50 % of the labelled pixels that were looked at, which are")
    assert f"{names}: does `labels.road` name the road?" in note
