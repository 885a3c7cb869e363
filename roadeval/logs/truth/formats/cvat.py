"""Label format: CVAT for images, in XML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

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

NO_AREAS = ("polyline", "points", "tag", "skeleton")


def _holds(_: Path, content: Any) -> bool:
    return bool(content.tag == "annotations")


def _read(path: Path, content: Element, _: Size | None) -> Iterator[Drawing]:
    if content.find("track") is not None:
        raise LogError(f"{path}: tracks of a video; export it as CVAT for images")
    for image in content.iter("image"):
        size = int(image.attrib["width"]), int(image.attrib["height"])
        # Equal heights stay in the order of the file.
        layers = sorted(image, key=lambda each: int(each.get("z_order", "0")))
        shapes = [_shape(each, path) for each in layers if each.tag not in NO_AREAS]
        yield Drawing(image.attrib["name"], size, shapes)


def _shape(element: Element, path: Path) -> Shape:
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


def _write(proposals: Sequence[Proposal]) -> dict[str, bytes]:
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


FORMAT = LabelFormat("CVAT for images", ".xml", _holds, _read, _write)
