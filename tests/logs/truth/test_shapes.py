"""Shapes of annotation tools beyond plain outlines, and the pixels of each."""

import copy
import json
import math
import random
import re
from base64 import b64encode
from xml.etree import ElementTree

import numpy as np
import pytest

from roadeval.images.decoding import png_of
from roadeval.images.formats import Limits
from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.settings import LabelSettings, MaskSettings
from roadeval.logs.truth.label_files import labels_in
from tests.logs.truth.test_formats import HEIGHT, SIZE, WIDTH, inside
from tests.logs.truth.test_label_files import coco, written

SQUARE = [[10, 10], [20, 10], [20, 20], [10, 20]]


def read(folder, name, content, *, ignore=(), road=("road",), **settings):
    """The truth of each label of a file by its name, and the warnings."""
    path = written(folder / "truth", name, content)
    return labels_of(path, MaskSettings(str(path), labels=LabelSettings(road, ignore), **settings))


def labels_of(path, settings):
    """The truth of each label by its name, and the warnings; lost labels by their reason."""
    origin = labels_in(path, SIZE, settings)
    truths = {}
    for label in origin.labels:
        try:
            picture = label.picture(label.content(), Limits())
        except BadMessage as error:
            truths[label.path.name] = str(error)
        else:
            values = np.frombuffer(picture.data, "<u2").reshape(picture.height, picture.width)
            names = ["", *origin.classes]
            truths[label.path.name] = np.array(names)[values]
    return truths, origin.notes


def one(folder, name, content, **settings):
    (label,) = read(folder, name, content, **settings)[0].values()
    return label


def image_xml(*shapes, size='width="48" height="32"'):
    return f'<annotations><image name="1.png" {size}>{"".join(shapes)}</image></annotations>'


def labelme(*shapes, **size):
    drawn = [{"label": label, "shape_type": kind, "points": at} for label, kind, at in shapes]
    return {"shapes": drawn, "imageWidth": WIDTH, "imageHeight": HEIGHT} | size


def task(*regions, data=None, **annotation):
    common = {"original_width": WIDTH, "original_height": HEIGHT, "to_name": "image"}
    made = {"result": [common | region for region in regions]} | annotation
    return {"id": 7, "data": data or {"image": "1.png"}, "annotations": [made]}


def percent(points):
    return [[100 * x / WIDTH, 100 * y / HEIGHT] for x, y in points]


def region(**value):
    return {"value": {"polygonlabels": ["road"], **value}}


def vector(*, curved=False, before=("p0", "p1", "p2"), **value):
    """A vector of Label Studio round the square; ``before`` are the points before its others."""
    vertices = [
        {"id": f"p{n}", "x": x, "y": y, "prevPointId": (None, *before)[n], "isBezier": curved}
        for n, (x, y) in enumerate(percent(SQUARE))
    ]
    return {
        "type": "vectorlabels",
        "value": {"vectorlabels": ["road"], "vertices": vertices} | value,
    }


POLYGON = region(points=percent(SQUARE))
VIA = {
    "shape_attributes": {
        "name": "polygon",
        "all_points_x": [x for x, _ in SQUARE],
        "all_points_y": [y for _, y in SQUARE],
    },
    "region_attributes": {"class": "road"},
}
VERTICES = {"vertices": SQUARE, "types": "LLLL", "closed": True}
VIA_IMAGE = {"filename": "1.png", "size": 9, "regions": [VIA]}
AREA = {"category": "road", "poly2d": [VERTICES]}
TYPED = {"category": "road", "poly2d": [[x, y, "L"] for x, y in SQUARE]}
CUT = "https://b.s3.amazonaws.com/x/1.png?X-Amz-Date=20240101T000000Z&X-Amz-Signature=a.b0"

SAME = {
    "Cityscapes": ("1.json", {"imgWidth": 48, "imgHeight": 32, "objects": [
        {"label": "road", "polygon": SQUARE},
        {"label": "car", "polygon": [[0, 0], [48, 0], [48, 32]], "deleted": 1},
    ]}),
    "VIA, a project": ("a.json", {"_via_settings": {}, "_via_img_metadata": {"1.png9": VIA_IMAGE}}),
    "VIA, an export": ("a.json", {"1.png9": VIA_IMAGE}),
    "VIA 1": ("a.json", {"1.png9": VIA_IMAGE | {"regions": {"0": VIA}}}),
    "VIA, ticked": ("a.json", {"1.png9": VIA_IMAGE | {"regions": [
        VIA | {"region_attributes": {"class": {"road": True, "car": False}, "wet": "no"}}
    ]}}),
    "Scalabel": ("a.json", {"frames": [{"name": "1.png", "labels": [AREA]}], "config": {}}),
    "BDD100K": ("a.json", [{"name": "0.png"}, {"name": "1.png", "labels": [AREA]}]),
    "BDD100K, an image": ("1.json", {"name": "1", "frames": [{"objects": [TYPED]}]}),
    "Scalabel, runs": ("a.json", [{"name": "1.png", "labels": [{"category": "road", "rle": {
        "counts": [10 * 32 + 10, *[10, 22] * 9, 10, 12 + 28 * 32], "size": [32, 48]}}]}]),
    "COCO, one list": ("a.json", coco([n for point in SQUARE for n in point])),
    "COCO, a list of points": ("a.json", coco(SQUARE)),
    "COCO without a size": ("a.json", coco([[n for p in SQUARE for n in p]], width=None)),
    "CVAT without a size": ("a.xml", image_xml(
        '<polygon label="road" points="10,10;20,10;20,20;10,20"/>', size="")),
    "CVAT, left by its track": ("a.xml", image_xml(
        '<polygon label="road" points="10,10;20,10;20,20;10,20" z_order="1.0"/>',
        '<polygon label="car" outside="1" points="10,10;20,10;20,20;10,20" z_order="2"/>')),
    "LabelMe without a size": ("1.json", labelme(
        ("road", "polygon", SQUARE), imageWidth=None, imageHeight=None)),
    "LabelMe, oriented": ("1.json", labelme(("road", "oriented_rectangle", SQUARE))),
    "X-AnyLabeling, four corners": ("1.json", labelme(("road", "quadrilateral", SQUARE))),
    "LabelMe, points and lines beside it": ("1.json", labelme(
        ("road", "polygon", SQUARE), ("car", "points", SQUARE), ("car", "linestrip", SQUARE))),
    "YOLO with empty lines": ("1.txt", "\nroad 1".replace("road 1", "5 " + " ".join(
        f"{x / WIDTH} {y / HEIGHT}" for x, y in SQUARE)) + "\n \n\n"),
    "Label Studio": ("a.json", [task(POLYGON)]),
    "Label Studio, signed": ("a.json", [task(POLYGON, data={"note": "x.jpg", "image": CUT})]),
    "Label Studio, another field": ("a.json", [task(POLYGON, data={"url": "s3://b/x/1.png"})]),
    "Label Studio, its disk": ("a.json", [
        task(POLYGON, data={"image": "/data/local-files/?d=a%20b/1.png"})]),
    "Label Studio, uploaded": ("a.json", [
        task(POLYGON, data={"image": "/data/upload/7/1a2b3c4d-1.png"})]),
    "Label Studio, two results": ("a.json", [task(
        {"id": "a", "type": "polygon", "value": {"points": percent(SQUARE), "closed": True}},
        {"id": "a", "type": "labels", "value": {"points": percent(SQUARE), "labels": ["road"]}})]),
    "Label Studio, a closed vector, and an open one beside it": ("a.json", [task(
        vector(closed=True), vector(closed=False, vectorlabels=["car"]) | {"id": "b"})]),
    "Label Studio, ground truth": ("a.json", [task(POLYGON, ground_truth=True) | {
        "annotations": [
            task(region(points=percent([[0, 0], [9, 0], [9, 9]])))["annotations"][0],
            task(POLYGON, ground_truth=True)["annotations"][0],
        ]}]),
}  # fmt: skip


@pytest.mark.parametrize("what", SAME)
def test_the_same_square_is_read_from_each_format(tmp_path, what):
    label = one(tmp_path, *SAME[what], road=("5",) if "YOLO" in what else ("road",))
    expected = np.where(inside(SQUARE), "5" if "YOLO" in what else "road", "")
    np.testing.assert_array_equal(label, expected)


def test_two_annotators_of_an_image_cost_it_and_are_named(tmp_path):
    both = [task(POLYGON, completed_by=n) for n in (1, 2)]
    one_task = [task(POLYGON) | {"annotations": [made["annotations"][0] for made in both]}]
    for content in (one_task, both):
        other = task(POLYGON, data={"image": "2.png"})  # its number is the same
        truths, _ = read(tmp_path, "a.json", [*content, other])
        assert truths["1.png"].startswith("it has 2 annotations (of annotators 1 and 2): mark one")
        assert (truths["2.png"] == "road").sum() == 100


@pytest.mark.parametrize(
    ("change", "what"), [({"curved": True}, "curves"), ({"before": ("p0", "p1", "p0")}, "branches")]
)
def test_a_vector_whose_area_is_not_known_costs_its_image(tmp_path, change, what):
    other = task(POLYGON, data={"image": "2.png"})
    truths, _ = read(tmp_path, "a.json", [task(vector(closed=True, **change)), other])
    assert truths["1.png"] == f"road is drawn as a vector with {what}"


def brushed(opacity):
    """The runs of Label Studio's brush, of one block without repetition."""
    pixels = np.repeat(np.uint8(opacity)[..., None], 4, axis=2).ravel()
    head = f"{pixels.size:032b}" + "00111" + "0010" + "0011" + "0111" + "1111"
    bits = head + "011" + f"{pixels.size - 1:016b}" + "".join(f"{n:08b}" for n in pixels)
    bits += "0" * (-len(bits) % 8)
    return [int(bits[n : n + 8], 2) for n in range(0, len(bits), 8)]


@pytest.mark.parametrize("opaque", [1, 100, 255])
def test_a_brushed_area_is_where_it_is_opaque_by_half_of_its_greatest_opacity(tmp_path, opaque):
    # The SDK writes 1 for truth values, 100 for contours; the brush itself 255, and less at edges.
    opacity = np.where(inside(SQUARE), opaque, 0)
    opacity[0, :2] = opaque // 2
    region = {"value": {"format": "rle", "rle": brushed(opacity), "brushlabels": ["road"]}}
    label = one(tmp_path, "a.json", [task(region)])
    np.testing.assert_array_equal(label == "road", inside(SQUARE))


def test_a_bitmask_of_another_size_is_not_put_into_the_corner(tmp_path):
    def bitmask(pixels):
        url = "data:image/png;base64," + b64encode(png_of(pixels)).decode()
        return {"value": {"imageDataURL": url, "bitmasklabels": ["road"]}}

    pixels = np.uint8(255) * inside(SQUARE)
    label = one(tmp_path, "a.json", [task(bitmask(pixels))])
    np.testing.assert_array_equal(label == "road", inside(SQUARE))
    other = task(POLYGON, data={"image": "2.png"})
    truths, _ = read(tmp_path, "a.json", [task(bitmask(pixels[::2, ::2])), other])
    assert truths["1.png"] == "a mask of road for an image of another size"


def test_a_task_of_several_images_is_that_of_its_first_or_costs_it(tmp_path):
    pages = {"note": "a", "pages": ["https://x/1.png", "https://x/2.png"]}
    label = one(tmp_path, "a.json", [task(POLYGON | {"item_index": 0}, data=pages)])
    np.testing.assert_array_equal(label == "road", inside(SQUARE))
    other = task(POLYGON, data={"image": "3.png"})
    truths, _ = read(tmp_path, "a.json", [task(POLYGON | {"item_index": 1}, data=pages), other])
    assert truths["1.png"] == "a region of road on a further image of the same task"


def test_an_address_without_an_ending_names_its_image(tmp_path):
    content = [task(POLYGON, data={"image": "https://x/0007", "by": "a.png"})]
    assert [*read(tmp_path, "a.json", content)[0]] == ["0007"]


TURNED = [(26.0, 11.0), (26.0, 31.0), (16.0, 31.0), (16.0, 11.0)]
ABOUT_CORNER = [(11.0, 16.0), (11.0, 36.0), (1.0, 36.0), (1.0, 16.0)]
AT = {"x": 100 * 11 / WIDTH, "y": 100 * 16 / HEIGHT, "rotation": 90}
BOX = AT | {"width": 100 * 20 / WIDTH, "height": 100 * 10 / HEIGHT}
Y, X = np.mgrid[:HEIGHT, :WIDTH] + 0.5 - np.array([16, 24])[:, None, None]
ALONG, ACROSS = (X * np.cos(a) + Y * np.sin(a) for a in (np.pi / 6, np.pi / 6 + np.pi / 2))
ELLIPSE, CIRCLE = (ALONG / 12) ** 2 + (ACROSS / 6) ** 2 < 1, np.hypot(X, Y) < 6


def via(**shape):
    return {"1.png9": VIA_IMAGE | {"regions": [VIA | {"shape_attributes": shape}]}}


DRAWN = {
    "CVAT, about its centre": ("a.xml", image_xml(
        '<box label="road" xtl="11" ytl="16" xbr="31" ybr="26" rotation="90"/>'
    ), inside(TURNED)),
    "Label Studio, about its first corner": (
        "a.json", [task(region(**BOX))], inside(ABOUT_CORNER)),
    "CVAT, a cuboid": ("a.xml", image_xml(
        '<cuboid label="road" xtl1="10" ytl1="10" xbl1="10" ybl1="20" xtr1="16" ytr1="10" '
        'xbr1="16" ybr1="20" xtl2="14" ytl2="6" xbl2="14" ybl2="16" xtr2="20" ytr2="6" '
        'xbr2="20" ybr2="16"/>'
    ), inside([(10, 10), (14, 6), (20, 6), (20, 16), (16, 20), (10, 20)])),
    "CVAT, an ellipse": ("a.xml", image_xml(
        '<ellipse label="road" cx="24" cy="16" rx="12" ry="6" rotation="30"/>'), ELLIPSE),
    "Label Studio, an ellipse": ("a.json", [
        task(region(x=50, y=50, radiusX=25, radiusY=18.75, rotation=30))], ELLIPSE),
    "VIA, an ellipse": (
        "a.json", via(name="ellipse", cx=24, cy=16, rx=12, ry=6, theta=np.pi / 6), ELLIPSE),
    "LabelMe, a circle": (
        "1.json", labelme(("road", "circle", [[24, 16], [30, 16]])), CIRCLE),
    "VIA, a circle": ("a.json", via(name="circle", cx=24, cy=16, r=6), CIRCLE),
}  # fmt: skip


@pytest.mark.parametrize("what", DRAWN)
def test_turned_boxes_cuboids_ellipses_and_circles_are_drawn(tmp_path, what):
    name, content, expected = DRAWN[what]
    off = (one(tmp_path, name, content) == "road") ^ expected
    has_edges_through_centres = "cuboid" in what or "about" in what
    assert off.sum() <= (12 if has_edges_through_centres else 2)


@pytest.mark.parametrize("types", ["LCCCL", "LCCL"])
def test_curves_of_bdd100k_are_cubic(tmp_path, types):
    """The curves are those of ``poly_to_patch`` in bdd100k 1.0, and of Scalabel 0.3."""
    points = [[10.2, 25.3], [10.2, 5.3], [35.2, 5.3], [35.2, 25.3], [22.2, 29.3]]
    vertices = points if types == "LCCCL" else points[:4]
    t = np.linspace(0, 1, 200)[:, None]
    a, b, c, d = np.array(points[:4])
    curve = a * (1 - t) ** 3 + 3 * b * t * (1 - t) ** 2 + 3 * c * t**2 * (1 - t) + d * t**3
    part = {"category": "road", "poly2d": [{"vertices": vertices, "types": types, "closed": True}]}
    label = one(tmp_path, "a.json", [{"name": "1.png", "labels": [part]}])
    expected = inside([*curve.tolist(), *vertices[4:]])
    assert ((label == "road") ^ expected).sum() <= 2


def test_a_curve_without_a_place_costs_its_image(tmp_path):
    part = {"category": "road", "poly2d": [{"vertices": [None], "types": "LCCL", "closed": True}]}
    lost = one(tmp_path, "a.json", [{"name": "1.png", "labels": [part]}])
    assert lost == "an outline of road whose points are not pixels"


@pytest.mark.parametrize(("what", "listed"), [("image", "images"), ("category", "categories")])
def test_ids_that_are_used_twice_are_refused(tmp_path, what, listed):
    content = coco([[0, 0, 9, 0, 9, 9]])
    content[listed] = [content[listed][0], content[listed][0] | {"name": "b", "file_name": "2"}]
    with pytest.raises(LogError, match=f"two entries have the {what} id 1"):
        read(tmp_path, "a.json", content)


def test_a_mask_of_another_size_than_its_image_costs_that_image(tmp_path):
    content = coco({"counts": [10, 48 * 32 - 10], "size": [48, 32]})
    content["images"].append({"id": 2, "file_name": "2.png", "width": 48, "height": 32})
    content["annotations"].append(
        content["annotations"][0] | {"image_id": 2, "segmentation": [[0, 0, 9, 0, 9, 9]]}
    )
    truths, _ = read(tmp_path, "a.json", content)
    assert truths["1.png"] == "a mask of road that is 32x48, on an image of 48x32"
    assert (truths["2.png"] == "road").any()


def test_a_damaged_file_costs_its_image_where_each_file_has_one(tmp_path):
    for n in range(3):
        content = {"name": f"{n}", "frames": [{"objects": [TYPED]}]}
        path = written(tmp_path / "truth", f"{n}.json", content)
    path.write_text(path.read_text()[:-9])
    settings = MaskSettings(str(path.parent), labels=LabelSettings(("road",)))
    truths, _ = labels_of(path.parent, settings)
    assert truths.pop("2.json").startswith("cannot be read as labels: it is not JSON, or ends")
    assert [(label == "road").sum() for label in truths.values()] == [100, 100]


# --- What the meaning of the classes decides ------------------------------------------------------


OUTLINES = {
    "road": [[0, 16, 48, 16, 48, 32, 0, 32]],
    "car": [[20, 18, 30, 18, 30, 28, 20, 28]],
    "tree": [[0, 0, 9, 0, 9, 9, 0, 9]],
}


def streets(*images):
    """COCO: of each image the classes of its annotations, each a polygon or, in brackets, a box."""
    size = {"width": 48, "height": 32}
    return {
        "images": [{"id": n, "file_name": f"{n}.png", **size} for n in range(len(images))],
        "categories": [{"id": n, "name": name} for n, name in enumerate(OUTLINES)],
        "annotations": [
            {
                "image_id": n,
                "category_id": [*OUTLINES].index(name.strip("[]")),
                "bbox": [20, 18, 10, 10],
                "segmentation": OUTLINES.get(name, []),
            }
            for n, classes in enumerate(images)
            for name in classes.split()
        ],
    }


def counts(label):
    return dict(zip(*(part.tolist() for part in np.unique(label, return_counts=True)), strict=True))


@pytest.mark.parametrize("order", ["car road", "road car"])
def test_an_ignored_class_is_ignored_wherever_it_was_drawn(tmp_path, order):
    truths, notes = read(tmp_path, "a.json", streets(order), ignore=("car",))
    assert counts(truths["0.png"]) == {"": 768, "car": 100, "road": 668}
    assert not notes


def test_road_over_an_earlier_class_is_told_with_its_share(tmp_path):
    content = streets("car road", "road car", "tree road")
    truths, (note,) = read(tmp_path, "a.json", content)
    assert counts(truths["0.png"])["road"] == 768
    assert note.startswith("road was drawn over car in 1 of 3 images: 13.0 % of the road's pixels")


def test_images_without_a_road_are_told_and_can_be_left_out(tmp_path):
    content = streets("road", "car", "tree car", "road tree")
    truths, (note,) = read(tmp_path, "a.json", content)
    assert len(truths) == 4
    assert note.startswith("2 of 4 images have shapes, but none of road, and are counted")
    assert "(1.png, 2.png); `truth.skip_roadless` leaves them out" in note
    truths, (note,) = read(tmp_path, "a.json", content, skip_roadless=True)
    assert [*truths] == ["0.png", "3.png"]
    assert "are left out (1.png, 2.png)" in note


def test_boxes_without_an_outline_are_told_with_number_and_class(tmp_path):
    content = streets("road [car]", "road car", "road")
    truths, (note,) = read(tmp_path, "a.json", content)
    assert counts(truths["0.png"])["road"] == 768
    assert note.startswith("1 of 5 shapes are not drawn: where they lie on the road, it counts as")
    assert note.endswith(": 1 of car (box without an outline)")
    truths, (note,) = read(tmp_path, "a.json", content, ignore=("car",))
    assert counts(truths["0.png"]) == {"": 768, "car": 100, "road": 668}
    assert "1 of 5 shapes are ignored as the boxes around them" in note


def test_a_box_in_place_of_the_road_costs_its_image(tmp_path):
    truths, _ = read(tmp_path, "a.json", streets("[road]", "road"))
    assert truths["0.png"] == "road is drawn as a box without an outline"
    assert counts(truths["1.png"])["road"] == 768


# --- One bad annotation among many costs its image alone, by name, whatever is wrong with it ------


IMAGES = 5
FILES = 24
"""Numbers of images and of changed files, for each format."""
BAD = (None, "x", [], {}, math.nan, math.inf, 1e300, [None], [[]], "")


def flat(points):
    return [number for point in points for number in point]


def coco_drawing(drawing):
    size = {"width": WIDTH, "height": HEIGHT}
    return {
        "images": [{"id": n, "file_name": f"{n}.png", **size} for n in range(IMAGES)],
        "categories": [{"id": 1, "name": "road"}, {"id": 2, "name": "car"}],
        "annotations": [
            {
                "image_id": n,
                "category_id": 1 + (label == "car"),
                "bbox": [1, 1, 5, 5],
                "segmentation": [flat(points)],
            }
            for n, shapes in enumerate(drawing)
            for label, points in shapes
        ],
    }


def label_studio(drawing):
    def region(place, label, points):
        value = {"points": percent(points), "polygonlabels": [label]}
        return {"id": f"{label}{place}", "value": value}

    return [
        task(*(region(i, *shape) for i, shape in enumerate(shapes)), data={"image": f"{n}.png"})
        for n, shapes in enumerate(drawing)
    ]


def via_drawing(drawing):
    def region(label, points):
        x, y = ([point[axis] for point in points] for axis in (0, 1))
        at = {"name": "polygon", "all_points_x": x, "all_points_y": y}
        return {"shape_attributes": at, "region_attributes": {"class": label}}

    return {
        f"{n}.png9": {"filename": f"{n}.png", "regions": [region(*shape) for shape in shapes]}
        for n, shapes in enumerate(drawing)
    }


def scalabel(drawing):
    def part(label, points):
        return {
            "category": label,
            "poly2d": [{"vertices": points, "types": "L" * len(points)}],
        }

    return [
        {"name": f"{n}.png", "labels": [part(*shape) for shape in shapes]}
        for n, shapes in enumerate(drawing)
    ]


def labelme_drawing(shapes):
    return labelme(*((label, "polygon", points) for label, points in shapes))


def cityscapes(shapes):
    drawn = [{"label": label, "polygon": points} for label, points in shapes]
    return {"objects": drawn, "imgWidth": WIDTH, "imgHeight": HEIGHT}


def cvat(drawing):
    return {
        f"{n}.png": [
            {"label": label, "points": ";".join(f"{x},{y}" for x, y in points)}
            for label, points in shapes
        ]
        for n, shapes in enumerate(drawing)
    }


def xml(content):
    """Write what `cvat` makes as CVAT does; an attribute that was taken away is not there."""
    root = ElementTree.Element("annotations")
    for name, shapes in content.items():
        size = {"width": str(WIDTH), "height": str(HEIGHT)}
        image = ElementTree.SubElement(root, "image", {"name": name, **size})
        for shape in shapes:
            ElementTree.SubElement(image, "polygon", shape)
    return ElementTree.tostring(root, "unicode")


def yolo(shapes):
    lines = [
        " ".join(map(str, [int(label == "car"), *(n / 100 for n in flat(percent(points)))]))
        for label, points in shapes
    ]
    return "\n".join(lines)


ANNOTATIONS = {
    coco_drawing: lambda content, n: [a for a in content["annotations"] if a["image_id"] == n],
    label_studio: lambda content, n: content[n]["annotations"][0]["result"],
    via_drawing: lambda content, n: content[f"{n}.png9"]["regions"],
    scalabel: lambda content, n: content[n]["labels"],
    labelme_drawing: lambda content, _: content["shapes"],
    cityscapes: lambda content, _: content["objects"],
    cvat: lambda content, n: content[f"{n}.png"],
}
ENDINGS = {yolo: ".txt", cvat: ".xml"}
ONE_IMAGE = (labelme_drawing, cityscapes, yolo)


def drawings(rng):
    """Some shapes for each image; the first is road."""

    def ring():
        return [[rng.uniform(0, WIDTH), rng.uniform(0, HEIGHT)] for _ in range(rng.randint(3, 6))]

    return [
        [("road", ring()), *(("car", ring()) for _ in range(rng.randint(1, 3)))]
        for _ in range(IMAGES)
    ]


def spoilt(annotation, rng):
    """Change or take away a random part of an annotation."""
    key = rng.choice([key for key in annotation if key not in {"image_id", "to_name", "id"}])
    while isinstance(annotation[key], dict | list) and annotation[key] and rng.random() < 0.6:
        annotation = annotation[key]
        keys = [*annotation] if isinstance(annotation, dict) else [*range(len(annotation))]
        key = rng.choice(keys)
    if isinstance(annotation, dict) and rng.random() < 0.3:
        del annotation[key]
    else:
        annotation[key] = copy.deepcopy(rng.choice(BAD))


def spoilt_text(text, rng):
    """Change or take away a number of a text."""
    numbers = re.split(r"([ ,;])", text)
    place = rng.randrange(0, len(numbers), 2)
    numbers[place] = rng.choice(["", "x", "nan", "1e300", "1,2"])
    return "".join(numbers)


def judged(before, after, notes, image):
    """Whether the image is lost of which an annotation was spoilt; all others must be as before."""
    assert after.keys() == before.keys()
    for name, label in before.items():
        if name != image:
            np.testing.assert_array_equal(after[name], label)
    reason = after[image]
    if isinstance(reason, str):
        assert "\n" not in reason
        assert not re.search(r"Error|NoneType|object|'(int|float|str|list)'", reason), reason
        return True
    other_class = "x" in after[image]
    assert notes or other_class or np.array_equal(reason, before[image]), "without a word"
    return False


def files_of(make, drawing):
    contents = [make(shapes) for shapes in drawing] if make in ONE_IMAGE else [make(drawing)]
    return {f"{n}{ENDINGS.get(make, '.json')}": content for n, content in enumerate(contents)}


def write(folder, files):
    for name, content in files.items():
        text = content if isinstance(content, str) else json.dumps(content)
        (folder / name).write_text(xml(content) if name.endswith(".xml") else text)
    path = folder if len(files) > 1 else folder / name
    road = ("0",) if name.endswith(".txt") else ("road",)
    return labels_of(path, MaskSettings(str(path), labels=LabelSettings(road)))


def spoil(files, make, image, rng):
    name = [*files][image if make in ONE_IMAGE else 0]
    if make is yolo:
        files[name] = spoilt_text(files[name], rng)
        return name
    annotation = rng.choice(ANNOTATIONS[make](files[name], image))
    if make is not cvat:
        spoilt(annotation, rng)
    else:
        key = rng.choice(["points", "points", "label"])
        text = spoilt_text(annotation.pop(key), rng)
        annotation |= {key: text} if rng.random() < 0.8 and key == "points" else {}
    return name if make in ONE_IMAGE else f"{image}.png"


@pytest.mark.parametrize("make", [*ANNOTATIONS, yolo])
def test_a_bad_annotation_costs_its_image_alone(tmp_path, make):
    rng = random.Random(7)
    lost = 0
    for _ in range(FILES):
        files = files_of(make, drawings(rng))
        before, _ = write(tmp_path, files)
        image = rng.randrange(IMAGES)
        name = spoil(files, make, image, rng)
        lost += judged(before, *write(tmp_path, files), name)
    assert lost > FILES / 4
