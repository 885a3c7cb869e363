"""The label formats of annotation tools."""

from __future__ import annotations

import json
import re
from base64 import b64decode
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from roadeval.images import Limits, to_rgb
from roadeval.logs.errors import LogError
from roadeval.logs.truth.drawn import (
    PROPOSED,
    Drawing,
    LabelFormat,
    Outline,
    Proposal,
    Runs,
    Shape,
    Size,
    rectangle,
)


def _unread(path: Path, what: str, instead: str = "") -> LogError:
    return LogError(f"{path}: it holds {what}, which roadeval does not read{instead}")


# --- COCO: polygons or runs of pixels, one JSON file ----------------------------------------------


def _is_coco(_: Path, content: Any) -> bool:
    keys = {"images", "annotations", "categories"}
    return isinstance(content, dict) and keys <= content.keys()


def _coco(path: Path, content: Mapping[str, Any], _: Size | None) -> Iterator[Drawing]:
    names = {each["id"]: str(each["name"]) for each in content["categories"]}
    own = defaultdict(list)
    for annotation in content["annotations"]:
        own[annotation["image_id"]].append(annotation)
    for image in content["images"]:
        annotations = own.pop(image["id"], [])
        size = int(image["width"]), int(image["height"])
        if annotations and "segments_info" in annotations[0]:
            raise LogError(f"{path}: COCO panoptic; save its masks as PNG files, one a frame")
        shapes = [s for each in annotations for s in _regions(each, names[each["category_id"]])]
        yield Drawing(str(image["file_name"]), size, shapes)
    if own:
        raise LogError(f"{path}: annotations are of image {next(iter(own))}, which is not listed")


def _regions(annotation: Mapping[str, Any], label: str) -> Iterator[Shape]:
    match annotation.get("segmentation"):
        case {"counts": counts}:
            lengths = lengths_in(counts) if isinstance(counts, str) else counts
            yield Runs(label, lengths, by_columns=True)
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


def _as_coco(proposals: Sequence[Proposal]) -> dict[str, bytes]:
    """Return one file, with a region of uncompressed runs for each image."""
    images, annotations = [], []
    for number, each in enumerate(proposals, 1):
        width, height = each.size
        rows, columns = (np.flatnonzero(each.road.any(axis=axis)).tolist() for axis in (1, 0))
        box = [0, 0, 0, 0]
        if rows:
            left, top = columns[0], rows[0]
            box = [left, top, columns[-1] + 1 - left, rows[-1] + 1 - top]
        images.append({"id": number, "file_name": each.image, "width": width, "height": height})
        about = {"id": number, "image_id": number, "category_id": 1, "iscrowd": 1}
        runs = {"size": [height, width], "counts": each.runs(by_columns=True)}
        annotations.append(
            {**about, "area": int(each.road.sum()), "bbox": box, "segmentation": runs}
        )
    content = {"images": images, "annotations": annotations}
    content["categories"] = [{"id": 1, "name": PROPOSED}]
    return {"instances.json": json.dumps(content).encode()}


COCO: Final = LabelFormat("COCO", ".json", _is_coco, _coco, _as_coco)

# --- CVAT for images, one XML file ----------------------------------------------------------------

_NO_AREAS: Final = ("polyline", "points", "tag", "skeleton")


def _cvat(path: Path, content: Element, _: Size | None) -> Iterator[Drawing]:
    if content.find("track") is not None:
        raise LogError(f"{path}: tracks of a video; export it as CVAT for images")
    for image in content.iter("image"):
        size = int(image.attrib["width"]), int(image.attrib["height"])
        # Equal heights stay in the order of the file.
        layers = sorted(image, key=lambda each: int(each.get("z_order", "0")))
        shapes = [_element(each, path) for each in layers if each.tag not in _NO_AREAS]
        yield Drawing(image.attrib["name"], size, shapes)


def _element(element: Element, path: Path) -> Shape:
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
            raise _unread(path, f"a shape ({other})")


def _as_cvat(proposals: Sequence[Proposal]) -> dict[str, bytes]:
    """Return one file, with a mask of runs for each image that shows road."""
    root = Element("annotations")
    SubElement(root, "version").text = "1.1"
    for number, each in enumerate(proposals):
        size = dict(zip(("width", "height"), map(str, each.size), strict=True))
        image = SubElement(root, "image", {"id": str(number), "name": each.image, **size})
        if each.road.any():
            runs = ", ".join(map(str, each.runs()))
            about = {"label": PROPOSED, "source": "auto", "occluded": "0", "z_order": "0"}
            SubElement(image, "mask", {**about, "rle": runs, "left": "0", "top": "0", **size})
    content: bytes = tostring(root, "utf-8", xml_declaration=True)
    return {"annotations.xml": content}


CVAT: Final = LabelFormat(
    "CVAT for images", ".xml", lambda _, content: content.tag == "annotations", _cvat, _as_cvat
)

# --- Label Studio's JSON and JSON-MIN; points are percents of the image's size --------------------

_UPLOADED: Final = re.compile(r"(?:.*[/=])?(?:[0-9a-f]{8}-)?(.+)")
"""An image's name, with the path and the eight digits that an upload puts before it."""
_AREAS: Final = "polygonlabels", "rectanglelabels", "brushlabels", "ellipselabels", "bitmasklabels"
"""The first two are read."""


def _is_label_studio(_: Path, content: Any) -> bool:
    first = content[0] if isinstance(content, list) and content else None
    return isinstance(first, dict) and ("annotations" in first or "annotation_id" in first)


def _label_studio(
    path: Path, content: list[Mapping[str, Any]], _: Size | None
) -> Iterator[Drawing]:
    for task in content:
        if "annotations" in task:
            made = [each["result"] for each in task["annotations"] if not each.get("was_cancelled")]
            values = [[{**r, **r["value"]} for r in result if "value" in r] for result in made]
        else:
            values = [[r for v in task.values() if isinstance(v, list) for r in v]]
        for shapes in values:  # of each annotator
            areas = [each for each in shapes if {*_AREAS} & each.keys()]
            size = (areas[0]["original_width"], areas[0]["original_height"]) if areas else None
            yield Drawing(_image(task), size, [_area(each, path) for each in areas])


def _image(task: Mapping[str, Any]) -> str:
    """Return the name of a task's image: the first of its data that names a file."""
    texts = [text for text in task.get("data", task).values() if isinstance(text, str)]
    name = next((text for text in texts if re.search(r"\.\w{3,4}$", text)), None)
    if name is None:
        raise ValueError("a task without an image")
    found = _UPLOADED.fullmatch(unquote(name))
    return found[1] if found else name


def _area(value: Mapping[str, Any], path: Path) -> Shape:
    kind = next(name for name in _AREAS if name in value)
    if kind not in _AREAS[:2]:
        raise _unread(path, kind, "; export masks as PNG")
    width, height = value["original_width"], value["original_height"]
    (label,) = map(str, value[kind])
    if kind == "polygonlabels":
        flat = [n for x, y in value["points"] for n in (x * width / 100, y * height / 100)]
        return Outline(label, flat)
    if value.get("rotation"):
        raise _unread(path, "a turned rectangle")
    left, top = value["x"] * width / 100, value["y"] * height / 100
    right, bottom = left + value["width"] * width / 100, top + value["height"] * height / 100
    return rectangle(label, left, top, right, bottom)


LABEL_STUDIO: Final = LabelFormat("Label Studio", ".json", _is_label_studio, _label_studio)

# --- LabelMe, and X-AnyLabeling, which writes the same: a JSON file an image ----------------------

SMALLEST: Final = 64
"""Area of an outline that is written, in quarters of a pixel."""
HOLE: Final = "other"


def _is_labelme(_: Path, content: Any) -> bool:
    return isinstance(content, dict) and {"shapes", "imageWidth", "imageHeight"} <= content.keys()


_LINES: Final = ("point", "points", "line", "linestrip")


def _labelme(path: Path, content: Mapping[str, Any], _: Size | None) -> Iterator[Drawing]:
    size = int(content["imageWidth"]), int(content["imageHeight"])
    own = [each for each in content["shapes"] if each.get("shape_type") not in _LINES]
    yield Drawing(str(path), size, [_shape(each, path) for each in own])


def _shape(shape: Mapping[str, Any], path: Path) -> Shape:
    label, points = str(shape["label"]), [float(n) for point in shape["points"] for n in point]
    match shape.get("shape_type", "polygon"), len(points):
        case "rectangle", 4:
            return rectangle(label, *points)
        case (("polygon" | "rotation" | "rectangle"), _):
            return Outline(label, points)
        case "mask", 4:
            pixels = to_rgb(b64decode(shape["mask"]), Limits())[..., 0] > 0
            area = Proposal("", pixels)
            return Runs(label, area.runs(), (int(points[0]), int(points[1]), *area.size))
        case other, _:
            raise _unread(path, f"a shape ({other})")


def _as_labelme(proposals: Sequence[Proposal]) -> dict[str, bytes]:
    """Return a file for each image, with its outlines; a hole is an outline of another class."""
    found = {}
    for each in proposals:
        width, height = each.size
        common: dict[str, Any] = {"shape_type": "polygon", "group_id": None, "flags": {}}
        shapes = [{"label": label, "points": ring, **common} for label, ring in _outlines(each)]
        content: dict[str, Any] = {
            "version": "5.0.0",
            "flags": {},
            "shapes": shapes,
            "imageData": None,
            "imagePath": f"../images/{each.image}",
            "imageHeight": height,
            "imageWidth": width,
        }
        found[f"{Path(each.image).stem}.json"] = json.dumps(content).encode()
    return found


def _outlines(proposal: Proposal) -> Iterator[tuple[str, list[list[float]]]]:
    """Yield outlines with few points, within a pixel; small holes and islands are left out."""
    import cv2

    road = np.pad(proposal.road.astype(np.uint8).repeat(2, 0).repeat(2, 1), 1)
    rings, parents = cv2.findContours(road, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    inner = np.zeros(0) if parents is None else parents[0, :, 3] >= 0
    for place in np.argsort(inner, kind="stable").tolist():
        ring = cv2.approxPolyDP(rings[place], 2.0, closed=True)[:, 0, :]
        if len(ring) > 2 and cv2.contourArea(rings[place]) >= SMALLEST:
            yield HOLE if inner[place] else PROPOSED, ((ring - 0.5) / 2).tolist()


LABELME: Final = LabelFormat("LabelMe", ".json", _is_labelme, _labelme, _as_labelme)

# --- YOLO segmentation, a text file an image; points are shares of its size -----------------------
# Classes have numbers; what they are called stands in files that differ from tool to tool.

_LINE: Final = re.compile(r"\d+( +[-+.\deE]+){4,}\s*")


def _is_yolo(_: Path, content: str) -> bool:
    return all(map(_LINE.fullmatch, filter(str.strip, content.splitlines())))


def _yolo(path: Path, content: str, size: Size | None) -> Iterator[Drawing]:
    if size is None:
        raise LogError(f"{path}: its points are shares of the image's size, which is not known")
    shapes: list[Shape] = []
    for line in content.splitlines():
        number, *shares = line.split()
        if len(shares) == 4:
            raise LogError(f"{path}: boxes, as for detection; road needs outlines")
        ring = [float(share) * size[place % 2] for place, share in enumerate(shares)]
        shapes.append(Outline(str(int(number)), ring))
    yield Drawing(str(path), size, shapes)


YOLO: Final = LabelFormat("YOLO segmentation", ".txt", _is_yolo, _yolo)

FORMATS: Final = (COCO, CVAT, LABEL_STUDIO, LABELME, YOLO)
