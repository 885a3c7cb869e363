"""Label format: VGG Image Annotator (VIA) 1 and 2, a project or an export, one JSON file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any, Final

from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.truth import drawn

_CLASS: Final = ("class", "label", "category", "type", "name", "object")
"""What the attribute is called that holds the class, where regions have several."""
_NO_AREAS: Final = ("point", "polyline")


def _images(content: Any) -> Mapping[str, Mapping[str, Any]]:
    if not isinstance(content, dict):
        return {}
    images = content.get("_via_img_metadata", content)
    return images if isinstance(images, dict) else {}


def _regions(image: Mapping[str, Any]) -> Iterable[Mapping[str, Any]]:
    """Return the regions of an image: a list, in VIA 1 a table."""
    regions = image["regions"]
    return regions.values() if isinstance(regions, dict) else regions


def _is_via(_: Path, content: Any) -> bool:
    images = _images(content).values()
    return any(isinstance(image, dict) and {"filename", "regions"} <= {*image} for image in images)


def _via(path: Path, content: Any, _: drawn.Size | None) -> Iterator[drawn.Drawing]:
    images = _images(content).values()
    regions = chain.from_iterable(map(_regions, images))
    names = {name for region in regions for name in region.get("region_attributes") or ()}
    usual = [name for usual in _CLASS for name in sorted(names) if name.lower() == usual]
    if len(names) > 1 and not usual:
        raise LogError(
            f"{path}: its regions have the attributes {', '.join(sorted(names))}: rename the one "
            "that is the class to `class`"
        )
    attribute = next(iter([*usual, *names]), "class")
    for image in images:
        areas = (
            region
            for region in _regions(image)
            if region["shape_attributes"]["name"] not in _NO_AREAS
        )
        yield drawn.Drawing(
            str(image["filename"]), None, (_shape(area, attribute) for area in areas)
        )


def _shape(region: Mapping[str, Any], attribute: str) -> drawn.Shape:
    at, value = region["shape_attributes"], (region.get("region_attributes") or {}).get(attribute)
    if isinstance(value, dict):  # boxes to tick
        (value,) = (name for name, is_ticked in value.items() if is_ticked)
    if not value or not isinstance(value, str):
        raise BadMessage(f"a region without a {attribute}")
    match at["name"]:
        case "polygon":
            pairs = zip(at["all_points_x"], at["all_points_y"], strict=True)
            return drawn.Outline(value, [number for pair in pairs for number in pair])
        case "rect":
            left, top = at["x"], at["y"]
            return drawn.rectangle(value, left, top, left + at["width"], top + at["height"])
        case "circle":
            return drawn.ellipse(value, at["cx"], at["cy"], at["r"], at["r"])
        case "ellipse":
            x, y, degrees = at["cx"], at["cy"], math.degrees(at.get("theta", 0))
            return drawn.ellipse(value, x, y, at["rx"], at["ry"]).turned(degrees, (x, y))
        case other:
            return drawn.Undrawn(value, str(other))


FORMATS: Final = (drawn.LabelFormat("VIA", ".json", _is_via, _via),)
