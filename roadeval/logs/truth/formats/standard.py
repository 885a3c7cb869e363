"""The label formats of annotation tools."""

from __future__ import annotations

import re
from base64 import b64decode
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote
from xml.etree.ElementTree import Element

import numpy as np

from roadeval.images import Limits, to_rgb
from roadeval.logs.errors import LogError
from roadeval.logs.truth.drawn import (
    Drawing,
    Drawn,
    LabelFormat,
    Outline,
    Runs,
    Segments,
    Shape,
    Size,
    rectangle,
)
from roadeval.runtime.documents import TOML_BYTES, read_bounded

# --- COCO, with polygons or runs of pixels, and COCO panoptic -------------------------------------


def _is_coco(_: Path, content: Any) -> bool:
    keys = {"images", "annotations", "categories"}
    return isinstance(content, dict) and keys <= content.keys()


def _coco(path: Path, content: Mapping[str, Any], _: Size | None) -> Iterator[Drawn]:
    names = {each["id"]: str(each["name"]) for each in content["categories"]}
    own = defaultdict(list)
    for annotation in content["annotations"]:
        own[annotation["image_id"]].append(annotation)
    for image in content["images"]:
        annotations = own.pop(image["id"], [])
        size = int(image["width"]), int(image["height"])
        if annotations and "segments_info" in annotations[0]:
            for each in annotations:
                segments = {int(s["id"]): names[s["category_id"]] for s in each["segments_info"]}
                bare = Path(each["file_name"]).name
                places = (path.with_suffix("") / bare, path.parent / bare)
                file = next((place for place in places if place.exists()), places[0])
                yield Segments(str(image["file_name"]), size, file, segments)
        else:
            shapes = [
                s for each in annotations for s in _coco_shapes(each, names[each["category_id"]])
            ]
            yield Drawing(str(image["file_name"]), size, shapes)
    if own:
        raise LogError(f"{path}: annotations are of image {next(iter(own))}, which is not listed")


def _coco_shapes(annotation: Mapping[str, Any], label: str) -> Iterator[Shape]:
    match annotation.get("segmentation"):
        case {"counts": str(text)}:
            yield Runs(label, lengths_in(text), by_columns=True)
        case {"counts": counts}:
            yield Runs(label, counts, by_columns=True)
        case [*polygons]:
            yield from (Outline(label, ring) for ring in polygons)


def lengths_in(text: str) -> Sequence[int]:
    """Return the lengths of the runs that COCO writes as a text.

    A number has five bits in each letter, the lowest ones first, and from the fourth number on it
    is the difference from the last but one.
    """
    lengths: list[int] = []
    value = shift = 0
    for letter in text.encode():
        code = letter - 48
        value |= (code & 31) << shift
        shift += 5
        if code & 32 and shift < 60:  # no number is longer
            continue
        if code & 16:
            value -= 1 << shift
        lengths.append(value + (lengths[-2] if len(lengths) > 2 else 0))
        value = shift = 0
    return lengths


# --- CVAT for images, in XML ----------------------------------------------------------------------

_CVAT_NO_AREAS = ("polyline", "points", "tag", "skeleton")


def _cvat(path: Path, content: Element, _: Size | None) -> Iterator[Drawing]:
    if content.find("track") is not None:
        raise LogError(f"{path}: tracks of a video; export it as CVAT for images")
    for image in content.iter("image"):
        size = int(image.attrib["width"]), int(image.attrib["height"])
        # Equal heights stay in the order of the file.
        layers = sorted(image, key=lambda each: int(each.get("z_order", "0")))
        shapes = [_cvat_shape(each, path) for each in layers if each.tag not in _CVAT_NO_AREAS]
        yield Drawing(image.attrib["name"], size, shapes)


def _cvat_shape(element: Element, path: Path) -> Shape:
    label, at = element.attrib["label"], element.attrib
    match element.tag:
        case "polygon":
            return Outline(label, [float(n) for n in at["points"].replace(";", ",").split(",")])
        case "box":
            return rectangle(label, *(float(at[each]) for each in ("xtl", "ytl", "xbr", "ybr")))
        case "mask":
            left, top, width, height = (int(at[n]) for n in ("left", "top", "width", "height"))
            lengths = [int(number) for number in at["rle"].split(",")]
            return Runs(label, lengths, (left, top, width, height))
        case other:
            raise LogError(f"{path}: it holds a shape ({other}) that roadeval does not read")


# --- Label Studio's JSON and JSON-MIN: points are percents of the image's size --------------------

_UPLOADED: Final = re.compile(r"(?:.*[/=])?(?:[0-9a-f]{8}-)?(.+)")
"""An image's name, with the path and the eight digits that an upload puts before it."""
_AREAS: Final = "polygonlabels", "rectanglelabels"
_UNREAD: Final = "brushlabels", "ellipselabels", "bitmasklabels"


def _is_label_studio(_: Path, content: Any) -> bool:
    first = content[0] if isinstance(content, list) and content else None
    return isinstance(first, dict) and ("annotations" in first or "annotation_id" in first)


def _label_studio(
    path: Path, content: list[Mapping[str, Any]], _: Size | None
) -> Iterator[Drawing]:
    for task in content:
        if "annotations" in task:
            made = [each for each in task["annotations"] if not each.get("was_cancelled")]
            results = [each["result"] for each in made]
            values = [[{**r, **r["value"]} for r in result if "value" in r] for result in results]
        else:
            values = [[r for v in task.values() if isinstance(v, list) for r in v]]
        for shapes in values:  # of each annotator
            areas = [each for each in shapes if {*_AREAS, *_UNREAD} & each.keys()]
            size = (areas[0]["original_width"], areas[0]["original_height"]) if areas else None
            yield Drawing(
                _label_studio_image(task), size, [_label_studio_shape(each, path) for each in areas]
            )


def _label_studio_image(task: Mapping[str, Any]) -> str:
    """Return the name of a task's image: the first of its data that names a file."""
    texts = [text for text in task.get("data", task).values() if isinstance(text, str)]
    name = next((text for text in texts if re.search(r"\.\w{3,4}$", text)), None)
    if name is None:
        raise ValueError("a task without an image")
    found = _UPLOADED.fullmatch(unquote(name))
    return found[1] if found else name


def _label_studio_shape(value: Mapping[str, Any], path: Path) -> Shape:
    kind = next(name for name in (*_AREAS, *_UNREAD) if name in value)
    if kind in _UNREAD:
        raise LogError(
            f"{path}: it holds {kind}, which roadeval does not read; export masks as PNG"
        )
    width, height = value["original_width"], value["original_height"]
    (label,) = map(str, value[kind])
    if kind == "polygonlabels":
        flat = [n for x, y in value["points"] for n in (x * width / 100, y * height / 100)]
        return Outline(label, flat)
    if value.get("rotation"):
        raise LogError(f"{path}: it holds a turned rectangle, which roadeval does not read")
    left, top = value["x"] * width / 100, value["y"] * height / 100
    return rectangle(
        label, left, top, left + value["width"] * width / 100, top + value["height"] * height / 100
    )


# --- LabelMe, and X-AnyLabeling, which writes the same: a JSON file an image ----------------------

_LABELME_NO_AREAS = ("point", "points", "line", "linestrip")


def _is_labelme(_: Path, content: Any) -> bool:
    return isinstance(content, dict) and {"shapes", "imageWidth", "imageHeight"} <= content.keys()


def _labelme(path: Path, content: Mapping[str, Any], _: Size | None) -> Iterator[Drawing]:
    size = int(content["imageWidth"]), int(content["imageHeight"])
    shapes = [
        _labelme_shape(each, path)
        for each in content["shapes"]
        if each.get("shape_type", "polygon") not in _LABELME_NO_AREAS
    ]
    yield Drawing(str(path), size, shapes)


def _labelme_shape(shape: Mapping[str, Any], path: Path) -> Shape:
    label, points = str(shape["label"]), [float(n) for point in shape["points"] for n in point]
    match shape.get("shape_type", "polygon"), len(points):
        case "rectangle", 4:
            return rectangle(label, *points)
        case (("polygon" | "rotation" | "rectangle"), _):
            return Outline(label, points)
        case "mask", 4:
            pixels = to_rgb(b64decode(shape["mask"]), Limits())[..., 0] > 0
            height, width = pixels.shape
            changes = np.flatnonzero(np.diff(pixels.ravel(), prepend=False))
            lengths = np.diff(changes, prepend=0, append=pixels.size).tolist()
            return Runs(label, lengths, (int(points[0]), int(points[1]), width, height))
        case other, _:
            raise LogError(f"{path}: it holds a shape ({other}) that roadeval does not read")


# --- ASAM OpenLABEL, with 2D polygons of objects in numbered frames -------------------------------


def _is_openlabel(_: Path, content: Any) -> bool:
    return isinstance(content, dict) and "openlabel" in content


def _openlabel(path: Path, content: Mapping[str, Any], size: Size | None) -> Iterator[Drawing]:
    known = content["openlabel"]
    types = {key: str(each["type"]) for key, each in known.get("objects", {}).items()}
    for number, frame in known.get("frames", {}).items():
        shapes: list[Shape] = []
        for key, each in frame.get("objects", {}).items():
            for polygon in each["object_data"].get("poly2d", ()):
                if polygon.get("mode", "MODE_POLY2D_ABSOLUTE") != "MODE_POLY2D_ABSOLUTE":
                    raise LogError(f"{path}: polygons of {polygon['mode']}, not of absolute points")
                if polygon.get("closed", True):
                    shapes.append(Outline(types[key], polygon["val"]))
        yield Drawing(str(int(number)), size, shapes)


# --- YOLO segmentation, a text file an image: points are shares of its size -----------------------

_YOLO_LINE: Final = re.compile(r"\d+( +[-+.\deE]+){4,}\s*")
_YOLO_LISTS: Final = ("classes.txt", "obj.names", "labels.txt")
"""Files with the name of a class in each line."""


def _is_yolo(path: Path, content: str) -> bool:
    lines = [line for line in content.splitlines() if line.strip()]
    return path.name not in _YOLO_LISTS and all(map(_YOLO_LINE.fullmatch, lines))


def _yolo(path: Path, content: str, size: Size | None) -> Iterator[Drawing]:
    if size is None:
        raise LogError(f"{path}: its points are shares of the image's size, which is not known")
    names, shapes = _yolo_names(path.parent), list[Shape]()
    for line in content.splitlines():
        number, *shares = line.split()
        if len(shares) == 4:
            raise LogError(f"{path}: boxes, as for detection; road needs outlines")
        ring = [float(share) * size[place % 2] for place, share in enumerate(shares)]
        shapes.append(Outline(names.get(int(number), number), ring))
    yield Drawing(str(path), size, shapes)


@lru_cache(maxsize=8)
def _yolo_names(folder: Path) -> Mapping[int, str]:
    """Return the names of the classes, from the files beside the labels or up to two folders up."""
    for place in (folder, *folder.parents[:2]):
        for file in sorted(place.glob("*.y*ml")):
            if found := _yolo_names_in(file):
                return found
        for name in _YOLO_LISTS:
            if (place / name).is_file():
                return dict(enumerate(read_bounded(place / name, TOML_BYTES).decode().splitlines()))
    return {}


def _yolo_names_in(file: Path) -> Mapping[int, str]:
    """Return ``names`` of a YAML file, a list or a table by numbers; nothing if it has none."""
    import yaml

    try:
        content: Any = yaml.safe_load(read_bounded(file, TOML_BYTES))
    except (yaml.YAMLError, RecursionError, ValueError, OSError):
        return {}
    names = content.get("names") if isinstance(content, dict) else None
    pairs = enumerate(names) if isinstance(names, list) else (names or {}).items()
    # A text of all else could be longer than any memory: YAML repeats by reference.
    return {int(number): name for number, name in pairs if isinstance(name, str)}


FORMATS = (
    LabelFormat("COCO", ".json", _is_coco, _coco),
    LabelFormat("CVAT for images", ".xml", lambda _, root: root.tag == "annotations", _cvat),
    LabelFormat("Label Studio", ".json", _is_label_studio, _label_studio),
    LabelFormat("LabelMe", ".json", _is_labelme, _labelme),
    LabelFormat("OpenLABEL", ".json", _is_openlabel, _openlabel),
    LabelFormat("YOLO segmentation", ".txt", _is_yolo, _yolo),
)
