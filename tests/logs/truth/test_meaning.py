"""The meaning of the values of a label image."""

import io
import json
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from mcap_ros2.writer import Writer
from PIL import Image

from roadeval.data import NO_CLASS
from roadeval.errors import SettingError
from roadeval.images.formats import Limits
from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.log import open_log
from roadeval.logs.messages.pictures import CompressedPicture, RawPicture
from roadeval.logs.messages.pixels import to_labels
from roadeval.logs.settings import FrameSettings, LabelSettings, LogConfig, MaskSettings
from roadeval.logs.truth.label_files import file_label
from roadeval.logs.truth.meaning import count_values, find_meaning, meaning_of
from roadeval.logs.truth.named_labels import LabelSet, find_keys
from tests.logs.making import COMPRESSED, HEADER, IMAGE, compressed, grey, header, jpeg, png, raw
from tests.logs.truth.test_folder import opened
from tests.logs.truth.test_formats import FOREIGN, LABELS, POINTS, SIZE, painted

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
        (LabelSettings(road=(7,), ignore=(9,)), "labels.road", "7 does not occur in /labels"),
    ],
)
def test_a_value_that_is_not_named_or_does_not_occur_is_refused(labels, setting, problem) -> None:
    with pytest.raises(LogError, match=problem) as refused:
        truth([0, 3, 11], labels)
    assert refused.value.setting == setting


@pytest.mark.parametrize("labels", [LabelSettings((3,), (9,)), LabelSettings((3, 9))])
def test_a_value_beside_road_may_be_rare_and_is_told(labels) -> None:
    table = find_meaning(labels, [[0, 3, 11], [3]], "/labels")
    assert table.notes == ("no label that was looked at holds 9: is it rare?",)
    assert table.meaning[9] == (1 if 9 in labels.road else 255)


NO_NAMES = "its keys must all be values, or all colours"


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"ignore": (3,)}, "`ignore`: needs `road`"),
        ({"ignore_colors": ((1, 2, 3),)}, "`ignore_colors`: needs `road_colors`"),
        ({"road": (1,), "road_colors": ((1, 2, 3),)}, "as values or as colours"),
        ({"names": {"road": "3"}}, NO_NAMES),
        ({"names": {"3": "road", "1,2,3": "car"}}, NO_NAMES),
        ({"names": {"1,2": "road"}}, NO_NAMES),
    ],
)
def test_settings_that_contradict_each_other_are_refused(settings, problem) -> None:
    with pytest.raises(SettingError if "names" in settings else ValueError, match=problem):
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


@pytest.mark.parametrize(
    ("palette", "values"),
    [
        ([0, 0, 0, 255, 255, 255, *CAR], [0, 1]),  # as the images in which there is a car
        ([255, 255, 255, 0, 0, 0], [255, 0]),
        ([255, 255, 255], [255]),  # road everywhere
    ],
)
def test_a_palette_means_the_same_whichever_of_its_colours_an_image_has(palette, values) -> None:
    for index, value in enumerate(values):
        assert to_labels(palette_png([[index, 0]], palette), LIMITS).tolist() == [
            [value, values[0]]
        ]


def meaning_of_palettes(folder, *pictures: CompressedPicture, **labels):
    for number, picture in enumerate(pictures):
        (folder / f"{number}.png").write_bytes(picture.data)
    place = MaskSettings(str(folder), labels=LabelSettings(**labels))
    origin = LabelSet(tuple(map(file_label, sorted(folder.iterdir()))))
    return meaning_of(find_keys(origin, str(folder), place, LIMITS), place)


BLACK = (0, 0, 0)
MANY = palette_png([[0, 1, 2]], [*BLACK, *CAR, *ROAD])
FEWER = palette_png([[0, 1, 1]], [*BLACK, *ROAD])
"""As `MANY`, written without the colours that do not occur, as an optimiser of PNG files does."""


def test_a_value_with_two_colours_is_refused_and_the_colours_are_read(tmp_path) -> None:
    problem = "1.png: its palette has the colour 64,32,32 for 1, and others have 204"
    with pytest.raises(LogError, match=rf"{problem},0,255; name .*`labels.road_colors`"):
        meaning_of_palettes(tmp_path, MANY, FEWER, road=(2,))
    meaning = meaning_of_palettes(tmp_path, MANY, FEWER, road_colors=(ROAD,))
    assert meaning.read(MANY, LIMITS).truth.tolist() == [[0, 0, 1]]
    assert meaning.read(FEWER, LIMITS).truth.tolist() == [[0, 1, 1]]


def test_a_label_with_another_palette_than_those_looked_at_is_no_label(tmp_path) -> None:
    meaning = meaning_of_palettes(tmp_path, MANY, MANY, road=(2,))
    assert meaning.read(MANY, LIMITS).truth.tolist() == [[0, 0, 1]]
    with pytest.raises(BadMessage, match="its palette has the colour 64,32,32 for 1, and others"):
        meaning.read(FEWER, LIMITS)


def test_colours_that_do_not_occur_may_differ(tmp_path) -> None:
    other = palette_png([[0, 1, 1]], [*BLACK, *CAR, *SKY])
    meaning = meaning_of_palettes(tmp_path, MANY, other, road=(2,))
    assert meaning.read(other, LIMITS).truth.tolist() == [[0, 0, 0]]


def test_a_palette_whose_second_colour_is_darker_is_no_mask_of_0_and_1(tmp_path) -> None:
    # Pillow sorts the colours of a quantised image so.
    with pytest.raises(LogError, match=r"0 and 1 of a palette.* 64,32,32 and 0,0,0; name the"):
        meaning_of_palettes(tmp_path, palette_png([[0, 1]], [*ROAD, *BLACK]))
    named = meaning_of_palettes(tmp_path, palette_png([[0, 1]], [*ROAD, *BLACK]), road=(0,))
    assert named.read(palette_png([[0, 1]], [*ROAD, *BLACK]), LIMITS).truth.tolist() == [[1, 0]]
    meaning = meaning_of_palettes(tmp_path, FEWER)
    assert meaning.read(FEWER, LIMITS).truth.tolist() == [[0, 1, 1]]


@pytest.mark.parametrize("labels", [LabelSettings(), LabelSettings(road=(255,))])
def test_labels_compressed_with_loss_are_refused_with_the_way_out(labels: LabelSettings) -> None:
    picture = CompressedPicture(0, "jpeg", jpeg(grey(255)))
    with pytest.raises(LogError, match=r"/labels is JPEG, .*: log labels as PNG"):
        count_values(picture, labels, "/labels", LIMITS)
    with pytest.raises(BadMessage, match="a JPEG, whose compression changes label values"):
        find_meaning(labels, [[0, 255]], "/labels").read(picture, LIMITS)


def test_a_tiff_is_refused_if_it_is_compressed_as_jpeg() -> None:
    labels, pictures = LabelSettings(road=(255,)), []
    for compression in ("jpeg", "tiff_deflate"):
        file = io.BytesIO()
        Image.fromarray(grey(255)).save(file, "tiff", compression=compression)
        pictures.append(CompressedPicture(0, "tiff", file.getvalue()))
    assert count_values(pictures[1], labels, "/labels", LIMITS) == {255: grey(255).size}
    with pytest.raises(LogError, match=r"/labels is TIFF of JPEG, .*: log labels as PNG"):
        count_values(pictures[0], labels, "/labels", LIMITS)
    with pytest.raises(BadMessage, match="a TIFF of JPEG, whose compression changes label values"):
        find_meaning(labels, [[0, 255]], "/labels").read(pictures[0], LIMITS)


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


# --- The classes of the truth: every label format that has them keeps them, and their names -------


LABEL_INFO = HEADER.format(
    fields="vision_msgs/VisionClass[] class_map\nfloat32 threshold\n" + "=" * 80 + "\n"
    "MSG: vision_msgs/VisionClass\nuint16 class_id\nstring class_name"
)


def names_in(label, meaning):
    """The name of each pixel's class, or its value."""
    names = [each.name or str(each.value) for each in meaning.classes]
    return np.array([*names, *[""] * NO_CLASS])[label.classes]


def meant(labels, picture, *later):
    """The meaning of a picture, and the names of the pixels of that one and of later ones."""
    meaning = find_meaning(labels, [count_values(picture, labels, "/labels", LIMITS)], "/labels")
    pictures = (picture, *later)
    return meaning, [names_in(meaning.read(p, LIMITS), meaning)[0].tolist() for p in pictures]


@pytest.mark.parametrize("path", FOREIGN)
def test_classes_of_drawn_labels_are_those_of_scikit_image(path):
    names = {"0": "road", "1": "car", "2": "ego"} if "yolo" in path else {}
    labels = opened(LABELS / path, SIZE)
    settings = MaskSettings(labels=LabelSettings(road=("road",), names=names))
    meaning = meaning_of(labels, settings)
    for place, number in enumerate(labels.log_times.tolist()):
        label = meaning.read(labels.picture(place), LIMITS)
        expected = np.where(FOREIGN[path][number] == "", "no shape", FOREIGN[path][number])
        np.testing.assert_array_equal(names_in(label, meaning), expected)


RINGS = {name: [[*point] for point in POINTS[name]] for name in ("road", "car")}
DOCUMENTS = {
    "Cityscapes": {
        "imgWidth": SIZE[0],
        "imgHeight": SIZE[1],
        "objects": [{"label": name, "polygon": ring} for name, ring in RINGS.items()],
    },
    "Scalabel": [
        {
            "name": "frame_0000.jpg",
            "labels": [
                {"category": name, "poly2d": [{"vertices": ring, "closed": True}]}
                for name, ring in RINGS.items()
            ],
        }
    ],
    "VIA": {
        "frame_0000.jpg": {
            "filename": "frame_0000.jpg",
            "regions": [
                {
                    "region_attributes": {"class": name},
                    "shape_attributes": {
                        "name": "polygon",
                        "all_points_x": [x for x, _ in ring],
                        "all_points_y": [y for _, y in ring],
                    },
                }
                for name, ring in RINGS.items()
            ],
        }
    },
}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_classes_of_documents_are_those_of_scikit_image(document, tmp_path):
    path = tmp_path / "frame_0000_gtFine_polygons.json"
    path.write_text(json.dumps(DOCUMENTS[document]))
    labels = opened(path, SIZE)
    meaning = meaning_of(labels, MaskSettings(labels=LabelSettings(road=("road",))))
    label = meaning.read(labels.picture(0), LIMITS)
    expected = painted("road", "car")
    expected[expected == ""] = "no shape"
    np.testing.assert_array_equal(names_in(label, meaning), expected)


@pytest.mark.parametrize("encoding", ["8UC1", "16UC1", "8SC1", "16SC1", "32SC1"])
def test_classes_of_whole_numbers_are_these_numbers_even_if_they_come_late(encoding):
    bits, is_signed = encoding.partition("SC1" if "S" in encoding else "UC1")[0], "S" in encoding
    first, later = [7, 3, 3, 11], [-1 if is_signed else 200, 3, 100, 7]
    kind = f"<{'i' if is_signed else 'u'}{int(bits) // 8}"
    pictures = [
        RawPicture(0, 4, 1, encoding, 0, big_endian=False, data=np.array(v, kind).tobytes())
        for v in (first, later)
    ]
    labels = LabelSettings(road=(3,), ignore=(11,), names={"7": "car"})
    meaning, names = meant(labels, *pictures)
    assert names == [["car" if value == 7 else str(value) for value in v] for v in (first, later)]
    truths = {each.value: each.truth for each in meaning.classes}
    assert truths == {
        7: "other",
        3: "road",
        11: "ignored",
        100: "other",
        later[0]: "ignored" if is_signed else "other",
    }


def test_classes_of_colours_are_called_by_their_colours_or_by_the_names_that_are_given():
    first, later = (
        [(64, 32, 32), (255, 0, 0), (0, 0, 255)],
        [(0, 0, 255), (9, 9, 9), (64, 32, 32)],
    )
    pictures = [
        CompressedPicture(0, "png", png(np.array([v], np.uint8)[..., ::-1])) for v in (first, later)
    ]
    names = {"64,32,32": "road", "255,0,0": "lane"}
    labels = LabelSettings(road=("road", "lane"), names=names).with_values("/labels")
    meaning, found = meant(labels, *pictures)
    assert found == [["road", "lane", "0,0,255"], ["0,0,255", "9,9,9", "road"]]
    assert meaning.read(pictures[0], LIMITS).truth.tolist() == [[1, 1, 0]]


def test_a_plain_mask_has_no_classes_and_more_than_255_have_no_codes():
    picture = CompressedPicture(0, "png", png(np.array([[0, 255, 128]], np.uint8)))
    plain = find_meaning(LabelSettings(), [[0, 255]], "/labels")
    assert plain.read(picture, LIMITS).classes is None
    assert plain.classes == []
    meaning = find_meaning(LabelSettings(road=(3,)), [[0, 3]], "/labels")
    codes = meaning.codes.of(np.arange(300, dtype=np.uint16))
    assert codes.tolist() == [*range(255), *[NO_CLASS] * 45]


def log_with_names(path, *infos, labels="/seg/labels"):
    """A log with ids 3, 4 and 11, and a ``LabelInfo`` on these topics."""
    ids = np.repeat(np.array([[4], [3], [11]], np.uint8), 8, 1)
    classes = [{"class_id": n, "class_name": name} for n, name in ((3, "road"), (4, "pavement"))]
    with path.open("wb") as file:
        writer = Writer(file)
        kinds = {"Image": IMAGE, "CompressedImage": COMPRESSED}
        image, packed = (
            writer.register_msgdef(f"sensor_msgs/msg/{name}", text) for name, text in kinds.items()
        )
        info = writer.register_msgdef("vision_msgs/msg/LabelInfo", LABEL_INFO)
        for topic in infos:
            named = {"header": header(1), "class_map": classes, "threshold": 0.5}
            writer.write_message(topic, info, named, 1)
        for stamp in (10**9, 2 * 10**9):
            writer.write_message("/camera", packed, compressed(stamp, jpeg(grey(9, 8, 3))), stamp)
            writer.write_message(labels, image, raw(stamp, ids, "mono8"), stamp)
        writer.finish()
    return path


def selected(path, *road, **more):
    with open_log(path, LogConfig(labels=LabelSettings(road=road, **more))) as log:
        selection = log.select()
        frame = next(log.frames(selection)).decode()
        return selection, frame


@pytest.mark.parametrize("info", ["/seg/label_info", "/seg/labels/info"])
def test_a_class_can_be_called_by_the_name_that_a_label_info_beside_its_topic_gives(tmp_path, info):
    path = log_with_names(tmp_path / "log.mcap", info, "/other/label_info")
    selection, frame = selected(path, "road")
    assert frame.truth[:, 0].tolist() == [0, 1, 0]
    names = [each.name for each in selection.classes]
    assert [names[code] for code in frame.classes[:, 0]] == ["pavement", "road", ""]
    assert selection.truth.meaning.words == "road is 3 (road)"


def test_a_name_that_nothing_gives_is_refused_with_the_names_there_are(tmp_path):
    path = log_with_names(tmp_path / "log.mcap", "/seg/label_info")
    with pytest.raises(LogError, match="rod is none of the classes of /seg/labels; these are road"):
        selected(path, "rod")
    elsewhere = log_with_names(tmp_path / "other.mcap", "/net/label_info", "/net/b/label_info")
    with pytest.raises(LogError, match=r"road does not occur in .*; name its values in `labels.na"):
        selected(elsewhere, "road")
    assert selected(elsewhere, "road", names={"3": "road"})[1].truth[1, 0] == 1


def test_a_reduced_frame_has_reduced_classes(tmp_path):
    path = log_with_names(tmp_path / "log.mcap", "/seg/label_info")
    labels = LabelSettings(road=("road",))
    with open_log(path, LogConfig(labels=labels, frames=FrameSettings(scale=0.5))) as log:
        frame = next(log.frames(log.select())).decode()
    assert frame.classes.shape == frame.truth.shape == (2, 4)


def test_ids_of_a_folder_can_be_called_by_name(tmp_path):
    folder = tmp_path / "labels"
    folder.mkdir()
    for number in range(2):
        cv2.imwrite(str(folder / f"{number}.png"), np.array([[3, 4, 11]], np.uint8))
    labels = LabelSettings(road=("road",), names={"3": "road"})
    meaning = meaning_of(opened(folder), MaskSettings(labels=labels))
    assert meaning.of_values(np.array([[3, 4]], np.uint8)).tolist() == [[1, 0]]


def test_names_of_values_in_the_log_are_none_of_colours():
    by_color = LabelSettings(road=("road",), names={"64,32,32": "road"})
    assert by_color.with_values("/labels", {"3": "car"}).road_colors == ((64, 32, 32),)
