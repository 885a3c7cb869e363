"""Label format: VGG Image Annotator (VIA) 1 and 2, a project or an export in one JSON file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.truth import shapes

_CLASS: Final = ("class", "label", "category", "type", "name", "object")
"""Names of the attribute for the class, if regions have several attributes."""


def _images(content: Any) -> Iterable[Mapping[str, Any]]:
    images = content.get("_via_img_metadata", content) if isinstance(content, dict) else {}
    keys = {"filename", "regions"}
    return (i for i in images.values() if isinstance(i, dict) and keys <= i.keys())


def _regions(image: Mapping[str, Any]) -> list[Any]:
    """Return the regions of an image, which are a list, or a table in VIA 1."""
    regions = image["regions"] or []
    return [*regions.values()] if isinstance(regions, dict) else regions


def read(path: Path, content: Any, _: shapes.Size | None) -> Iterator[shapes.DrawnLabel]:
    """Yield the label of each image."""
    regions = [region for image in _images(content) for region in _regions(image)]
    tables = (region.get("region_attributes") for region in regions if isinstance(region, dict))
    names = {name for table in tables if isinstance(table, dict) for name in table}
    usual = [name for usual in _CLASS for name in sorted(names) if name.lower() == usual]
    if len(names) > 1 and not usual:
        problem = f"its regions have the attributes {', '.join(sorted(names))}"
        raise LogError(problem, where=path, remedy="rename the one that is the class to 'class'")
    attribute = next(iter([*usual, *names]), "class")
    for image in _images(content):
        polygons = (
            _shape(region, attribute)
            for region in _regions(image)
            if region["shape_attributes"]["name"] not in ("point", "polyline")
        )
        yield shapes.DrawnLabel(str(image["filename"]), None, polygons)


def _shape(region: Mapping[str, Any], attribute: str) -> shapes.Shape:
    at, value = region["shape_attributes"], (region.get("region_attributes") or {}).get(attribute)
    if isinstance(value, dict):  # boxes to tick
        (value,) = (name for name, is_ticked in value.items() if is_ticked)
    if not value or not isinstance(value, str):
        raise BadMessage(f"a region without a {attribute}")
    match at["name"]:
        case "polygon":
            points = zip(at["all_points_x"], at["all_points_y"], strict=True)
            return shapes.Outline(value, shapes.flatten(points))
        case "rect":
            left, top = at["x"], at["y"]
            return shapes.rectangle(value, left, top, left + at["width"], top + at["height"])
        case "circle":
            return shapes.ellipse(value, at["cx"], at["cy"], at["r"], at["r"])
        case "ellipse":
            x, y, degrees = at["cx"], at["cy"], math.degrees(at.get("theta", 0))
            return shapes.ellipse(value, x, y, at["rx"], at["ry"]).rotate(degrees, (x, y))
        case other:
            return shapes.Undrawn(value, str(other))


FORMAT: Final = shapes.LabelFormat("VIA", ".json", lambda _, content: any(_images(content)), read)
