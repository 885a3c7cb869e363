"""One bad annotation among many costs its image alone, by name, whatever is wrong with it."""

import copy
import json
import math
import random
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from roadeval.logs.settings import LabelSettings, MaskSettings
from tests.logs.truth.test_formats import HEIGHT, WIDTH
from tests.logs.truth.test_shapes import labelme as square_of_labelme
from tests.logs.truth.test_shapes import labels_of, percent, task

IMAGES = 5
FILES = 24
"""Numbers of images and of changed files, for each format."""
BAD = (None, "x", [], {}, math.nan, math.inf, 1e300, [None], [[]], "")


def flat(points):
    return [number for point in points for number in point]


def coco(drawing):
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


def via(drawing):
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


def labelme(shapes):
    return square_of_labelme(*((label, "polygon", points) for label, points in shapes))


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
    coco: lambda content, n: [a for a in content["annotations"] if a["image_id"] == n],
    label_studio: lambda content, n: content[n]["annotations"][0]["result"],
    via: lambda content, n: content[f"{n}.png9"]["regions"],
    scalabel: lambda content, n: content[n]["labels"],
    labelme: lambda content, _: content["shapes"],
    cityscapes: lambda content, _: content["objects"],
    cvat: lambda content, n: content[f"{n}.png"],
}
ENDINGS = {yolo: ".txt", cvat: ".xml"}
ONE_IMAGE = (labelme, cityscapes, yolo)


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
