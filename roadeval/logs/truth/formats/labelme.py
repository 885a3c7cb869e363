"""Label format: LabelMe and X-AnyLabeling, in a JSON file for each image."""

from __future__ import annotations

import math
from base64 import b64decode
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from roadeval.images.decoding import to_rgb
from roadeval.images.formats import Limits
from roadeval.logs.truth import drawn

_CORNERS: Final = ("polygon", "rectangle", "rotation", "oriented_rectangle", "quadrilateral")


def _read_labelme(
    path: Path, content: Mapping[str, Any], _: drawn.Size | None
) -> Iterator[drawn.DrawnLabel]:
    lines = ("point", "points", "line", "linestrip")
    areas = (shape for shape in content["shapes"] if shape.get("shape_type") not in lines)
    size = drawn.size_in(content, "imageWidth", "imageHeight")
    yield drawn.DrawnLabel(str(path), size, map(_shape, areas))


def _shape(shape: Mapping[str, Any]) -> drawn.Shape:
    label, points = shape["label"], drawn.flatten(shape["points"])
    match shape.get("shape_type") or "polygon", points:
        case "rectangle", [left, top, right, bottom]:
            return drawn.rectangle(label, left, top, right, bottom)
        case kind, [_, _, _, _, _, _, *_] if kind in _CORNERS:
            return drawn.Outline(label, points)
        case "circle", [x, y, edge_x, edge_y]:
            radius = math.hypot(edge_x - x, edge_y - y)
            return drawn.ellipse(label, x, y, radius, radius)
        case "cuboid", [_, _, _, _, _, _, *_]:
            return drawn.hull(label, points)
        case "mask", [left, top, _, _]:
            pixels = to_rgb(b64decode(shape["mask"]), Limits())[..., 0] > 0
            return drawn.runs_of(label, pixels, int(left), int(top))
        case other, _:
            return drawn.Undrawn(label, f"{other} of {len(points) // 2} points")


FORMATS: Final = (
    drawn.LabelFormat(
        "LabelMe", ".json", drawn.has_keys("shapes", "imageWidth", "imageHeight"), _read_labelme
    ),
)
