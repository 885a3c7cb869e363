"""Label format: LabelMe and X-AnyLabeling, in a JSON file for each image."""

from __future__ import annotations

import math
from base64 import b64decode
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from roadeval.images.decoding import to_rgb
from roadeval.images.formats import Limits
from roadeval.logs.truth import shapes

_CORNERS: Final = ("polygon", "rectangle", "rotation", "oriented_rectangle", "quadrilateral")


def read(
    path: Path, content: Mapping[str, Any], _: shapes.Size | None
) -> Iterator[shapes.DrawnLabel]:
    """Yield the label of the file's image."""
    lines = ("point", "points", "line", "linestrip")
    areas = (shape for shape in content["shapes"] if shape.get("shape_type") not in lines)
    size = shapes.size_in(content, "imageWidth", "imageHeight")
    yield shapes.DrawnLabel(str(path), size, map(_shape, areas))


def _shape(shape: Mapping[str, Any]) -> shapes.Shape:
    label, points = shape["label"], shapes.flatten(shape["points"])
    match shape.get("shape_type") or "polygon", points:
        case "rectangle", [left, top, right, bottom]:
            return shapes.rectangle(label, left, top, right, bottom)
        case kind, [_, _, _, _, _, _, *_] if kind in _CORNERS:
            return shapes.Outline(label, points)
        case "circle", [x, y, edge_x, edge_y]:
            radius = math.hypot(edge_x - x, edge_y - y)
            return shapes.ellipse(label, x, y, radius, radius)
        case "cuboid", [_, _, _, _, _, _, *_]:
            return shapes.hull(label, points)
        case "mask", [left, top, _, _]:
            pixels = to_rgb(b64decode(shape["mask"]), Limits())[..., 0] > 0
            return shapes.runs_of(label, pixels, int(left), int(top))
        case other, _:
            return shapes.Undrawn(label, f"{other} of {len(points) // 2} points")


FORMAT: Final = shapes.LabelFormat(
    "LabelMe", ".json", shapes.has_keys("shapes", "imageWidth", "imageHeight"), read
)
