"""The classes of the truth: every label format that has them keeps them, and their names."""

import json

import cv2
import numpy as np
import pytest
from mcap_ros2.writer import Writer

from roadeval.data import NO_CLASS
from roadeval.errors import SettingError
from roadeval.images.formats import Limits
from roadeval.logs.errors import LogError
from roadeval.logs.log import open_log
from roadeval.logs.messages.pictures import CompressedPicture, RawPicture
from roadeval.logs.settings import FrameSettings, LabelSettings, LogConfig, MaskSettings
from roadeval.logs.truth.meaning import count_values, find_meaning, meaning_of
from tests.logs.making import COMPRESSED, HEADER, IMAGE, compressed, grey, header, jpeg, png, raw
from tests.logs.truth.test_folder import opened
from tests.logs.truth.test_formats import FOREIGN, LABELS, POINTS, SIZE, painted

LIMITS = Limits()
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


@pytest.mark.parametrize("names", [{"road": "3"}, {"3": "road", "1,2,3": "car"}, {"1,2": "road"}])
def test_names_of_something_else_than_values_or_colours_are_refused(names):
    with pytest.raises(SettingError, match="its keys must all be values, or all colours"):
        LabelSettings(names=names)


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
