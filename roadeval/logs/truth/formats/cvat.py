"""Label format: CVAT for images, in one XML file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from roadeval.logs.errors import LogError
from roadeval.logs.truth import shapes


def read(path: Path, content: Element, _: shapes.Size | None) -> Iterator[shapes.DrawnLabel]:
    """Yield the label of each image."""
    if content.find("track") is not None:
        raise LogError("tracks of a video", where=path, remedy="export it as CVAT for images")
    for image in content.iter("image"):
        yield shapes.DrawnLabel(image.attrib["name"], shapes.size_in(image.attrib), _shapes(image))


def _shapes(elements: Iterable[Element]) -> Iterator[shapes.Shape]:
    # Shapes of equal height stay in the order of the file. Datumaro writes shapes ``outside``, too.
    without_area = ("polyline", "points", "tag", "skeleton")
    for element in sorted(elements, key=lambda shape: float(shape.get("z_order", 0))):
        if element.tag in without_area or element.get("outside") == "1":
            continue
        label, at = element.attrib["label"], element.attrib
        degrees = float(at.get("rotation", 0))
        match element.tag:
            case "polygon":
                points = at["points"].replace(";", ",").split(",")
                yield shapes.Outline(label, [*map(float, points)])
            case "box":
                left, top, right, bottom = (float(at[n]) for n in ("xtl", "ytl", "xbr", "ybr"))
                box = shapes.rectangle(label, left, top, right, bottom)
                yield box.rotate(degrees, ((left + right) / 2, (top + bottom) / 2))
            case "ellipse":
                x, y, across, down = (float(at[name]) for name in ("cx", "cy", "rx", "ry"))
                yield shapes.ellipse(label, x, y, across, down).rotate(degrees, (x, y))
            case "cuboid":
                corners = [side + end for side in ("tl", "bl", "tr", "br") for end in "12"]
                points = [at[axis + corner] for corner in corners for axis in "xy"]
                yield shapes.hull(label, [*map(float, points)])
            case "mask":
                left, top, width, height = (int(at[n]) for n in ("left", "top", "width", "height"))
                lengths = [int(number) for number in at["rle"].split(",")]
                yield shapes.Runs(label, lengths, (left, top, width, height))
            case other:
                yield shapes.Undrawn(label, other)


FORMAT: Final = shapes.LabelFormat(
    "CVAT for images", ".xml", lambda _, content: content.tag == "annotations", read
)
