"""Files of annotation tools give the pixels that independent implementations give."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pycocotools import mask as coco
from skimage.draw import polygon2mask

from roadeval.data import ROAD
from roadeval.images.formats import Limits
from roadeval.logs.errors import LogError
from roadeval.logs.settings import LabelSettings
from roadeval.logs.truth.formats.coco import as_coco, lengths_in
from roadeval.logs.truth.label_files import labels_in
from roadeval.logs.truth.meaning import find_class_meaning
from roadeval.logs.truth.shapes import Outline, Proposal, Runs
from tests.logs.truth.test_folder import opened

LABELS = Path(__file__).parents[2] / "fixtures" / "labels"
SIZE = WIDTH, HEIGHT = 48, 32
POINTS = {
    "road": [(4.3, 31.7), (18.6, 10.4), (29.7, 10.9), (44.1, 31.2), (25.2, 24.6)],
    "car": [(20.2, 13.3), (31.4, 13.7), (30.8, 22.2), (21.1, 21.9)],
    "ego": [(-6.4, 27.3), (24.5, 26.1), (52.7, 28.8), (52.2, 37.6), (-6.1, 37.3)],
}
BLOB = np.zeros((HEIGHT, WIDTH), bool)
for row, (first, end) in enumerate(
    [(4, 5), (2, 7), (1, 8), (0, 9), (1, 8), (2, 7), (4, 5)], start=12
):
    BLOB[row, 10 + first : 10 + end] = True


def inside(points):
    """Pixels whose centre lies inside, by scikit-image, for which centres are whole numbers."""
    return polygon2mask((HEIGHT, WIDTH), np.array(points)[:, ::-1] - 0.5)


def painted(*shapes):
    """Names of the classes, the later shape over the earlier one; empty where there is none."""
    names = np.zeros((HEIGHT, WIDTH), "U12")
    for name in shapes:
        label, area = ("car", BLOB) if name == "blob" else (name, inside(POINTS[name]))
        names[area] = label
    return names


WHOLE = {0: painted("road", "car", "ego"), 3: painted("car", "road")}
FOREIGN = {
    "coco/datumaro.json": {**WHOLE, 1: painted("road", "blob")},
    "coco/labelformat.json": {**WHOLE, 1: painted("road", "blob")},
    "coco/pycocotools.json": {**WHOLE, 1: painted("road", "blob")},
    "cvat/annotations.xml": {**WHOLE, 1: painted("road", "blob")},
    "cvat/boxed.xml": {1: painted("road", "blob")},
    "labelme": {**WHOLE, 1: painted("road", "blob")},
    "yolo/labels": {**WHOLE, 1: painted("road")},
    "label_studio/tasks.json": {**WHOLE, 1: painted("road")},
    "label_studio/min.json": {**WHOLE, 1: painted("road")},
}


def values_of(path, size=SIZE):
    """By the number of each frame the values of its label, and the values of the classes."""
    labels = opened(path, size)
    pictures = [label.picture(label.content(), Limits()) for label in labels.labels]
    arrays = [np.frombuffer(p.data, "<u2").reshape(p.height, p.width) for p in pictures]
    return dict(zip(labels.log_times.tolist(), arrays, strict=True)), labels.origin


def names_of(path, size=SIZE):
    values, origin = values_of(path, size)
    called = {"0": "road", "1": "car", "2": "ego"}  # in the files of YOLO, which have numbers
    class_names = sorted(origin.classes, key=origin.classes.__getitem__)
    names = np.array(["", *(called.get(name, name) for name in class_names)])
    return {number: names[pixels] for number, pixels in values.items()}


@pytest.mark.parametrize("path", FOREIGN)
def test_a_file_of_the_formats_own_tool_gives_the_pixels_of_scikit_image(path):
    names = names_of(LABELS / path)
    assert names.keys() == FOREIGN[path].keys()
    for number, expected in FOREIGN[path].items():
        np.testing.assert_array_equal(names[number], expected)


def test_rectangles_of_x_anylabeling_may_be_turned():
    names = names_of(LABELS / "x_anylabeling")
    np.testing.assert_array_equal(names[0], WHOLE[0])
    expected = painted()
    expected[inside([(20.2, 13.3), (31.4, 13.3), (31.4, 22.2), (20.2, 22.2)])] = "car"
    expected[inside([(20.2, 20.3), (30.1, 16.3), (34.9, 28.4), (25.0, 32.4)])] = "road"
    np.testing.assert_array_equal(names[3], expected)


def test_what_no_shape_covers_is_non_road():
    values, origin = values_of(LABELS / "labelme")
    meaning = find_class_meaning(LabelSettings(road=("road",)), origin, "labels")
    np.testing.assert_array_equal(meaning.of_values(values[0]) == 1, WHOLE[0] == "road")


@pytest.mark.parametrize(
    ("labels", "setting", "problem"),
    [
        (LabelSettings(("Road",)), "labels.road", "Road does not occur in labels, which has the"),
        (LabelSettings(("road",), ("sky",)), "labels.ignore", "sky does not occur in labels"),
        (LabelSettings(), "", "labels has the classes car (3 labels), road (3 labels), ego (1"),
    ],
)
def test_a_class_that_does_not_occur_is_refused_with_the_list(labels, setting, problem):
    origin = labels_in(LABELS / "cvat" / "annotations.xml", SIZE)
    with pytest.raises(LogError, match=re.escape(problem)) as refused:
        find_class_meaning(labels, origin, "labels")
    assert refused.value.setting == setting
    with pytest.raises(LogError, match=r"ego \(1 label\); 2 labels of it cannot be read"):
        find_class_meaning(LabelSettings(("Road",)), replace(origin, lost=2), "labels")


def test_a_lone_class_called_road_needs_no_naming():
    origin = labels_in(LABELS / "cvat" / "annotations.xml", SIZE)
    lone = replace(origin, classes={"road": origin.classes["road"]})
    meaning = find_class_meaning(LabelSettings(), lone, "labels")
    assert meaning.words == "road is road"
    assert meaning.meaning[lone.classes["road"]] == ROAD


def test_of_four_files_a_frame_that_cityscapes_has_the_ids_are_taken(tmp_path):
    where = shutil.copytree(LABELS / "cityscapes", tmp_path / "gtFine")
    road = [{"label": "road", "polygon": [[0, 0]]}]
    for number in (0, 1, 3):
        content = json.dumps({"imgHeight": 32, "imgWidth": 48, "objects": road})
        (where / f"frame_{number:04d}_gtFine_polygons.json").write_text(content)
    labels = opened(where)
    assert [label.path.name[10:] for label in labels.labels] == ["_gtFine_labelIds.png"] * 3
    assert labels.log_times.tolist() == [0, 1, 3]


NAMES = {
    "Cityscapes": ("aachen_000001_000019_leftImg8bit", "aachen_000001_000019_gtFine_labelIds"),
    "KITTI": ("um_000012", "um_road_000012"),
    "KITTI, several lanes": ("umm_000012", "umm_road_000012"),
    "BDD100K, drivable area": ("b1c66a42-6f7d68ca", "b1c66a42-6f7d68ca_drivable_id"),
    "BDD100K, classes": ("b1c66a42-6f7d68ca", "b1c66a42-6f7d68ca_train_id"),
    "Mapillary": ("_0B-yJ1Ylq5ruDTTfGGN_w", "_0B-yJ1Ylq5ruDTTfGGN_w"),
    "CamVid": ("0016E5_00390", "0016E5_00390_L"),
}


@pytest.mark.parametrize("name", NAMES)
def test_labels_with_the_names_of_a_data_set_belong_to_their_images(name, tmp_path):
    image, label = NAMES[name]
    for folder, file in (("images", image), ("labels", label)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f"{file}.png").touch()
    labels = opened(tmp_path / "labels", images=str(tmp_path / "images"))
    assert (labels.by, labels.log_times.tolist(), labels.nameless) == ("name", [0], 0)


@pytest.mark.parametrize("path", ["cvat/annotations.xml", "labelme", "label_studio/tasks.json"])
def test_drawn_labels_belong_to_the_images_that_they_name(path, tmp_path):
    for number in (3, 1, 0, 2):
        (tmp_path / f"frame_{number:04d}.png").touch()
    labels = opened(LABELS / path, SIZE, images=str(tmp_path))
    assert (labels.by, labels.log_times.tolist(), labels.images) == ("name", [0, 1, 3], 4)


# --- The rules ------------------------------------------------------------------------------------

RINGS = st.lists(
    st.tuples(st.floats(-20, 70, width=32), st.floats(-20, 50, width=32)), min_size=3, max_size=9
)


@given(RINGS)
def test_an_outline_holds_the_pixels_whose_centre_is_inside_by_the_even_odd_rule(points):
    # Not on a centre's row or column, where tools differ in what an edge belongs to.
    points = [
        (np.floor(x) + 0.2371, np.floor(y) + 0.6113 + i / 997) for i, (x, y) in enumerate(points)
    ]
    filled = Outline("road", np.ravel(points).tolist()).fill(SIZE)
    assert (filled ^ inside(points)).sum() <= 1  # an edge through a centre


def runs_are_those_of_pycocotools(mask):
    encoded = coco.encode(np.asfortranarray(mask.astype(np.uint8)))
    lengths = lengths_in(encoded["counts"].decode())
    height, width = mask.shape
    runs = Runs("road", lengths, by_columns=True)
    np.testing.assert_array_equal(runs.fill((width, height)), mask)
    text = coco.frPyObjects({"size": mask.shape, "counts": list(lengths)}, height, width)
    assert text["counts"] == encoded["counts"]


@given(arrays(bool, (HEIGHT, WIDTH)))
def test_runs_are_those_of_pycocotools(mask):
    runs_are_those_of_pycocotools(mask)


@pytest.mark.parametrize("seed", range(6))
def test_long_runs_are_those_of_pycocotools(seed):
    rng = np.random.default_rng(seed)
    mask = np.repeat(rng.random(40) < 0.5, rng.integers(1, 60_000, 40))
    runs_are_those_of_pycocotools(np.resize(mask, (1080, 1920)))


@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
@given(arrays(bool, (HEIGHT, WIDTH)))
def test_the_area_and_the_box_of_a_coco_proposal_are_those_of_its_runs(road):
    (content,) = as_coco([Proposal("a.png", road)]).values()
    (region,) = json.loads(content)["annotations"]
    runs = coco.frPyObjects(region["segmentation"], HEIGHT, WIDTH)
    assert (coco.decode(runs) == road).all()
    assert region["area"] == coco.area(runs)
    assert region["bbox"] == coco.toBbox(runs).tolist()
