"""Label format: LabelMe, and X-AnyLabeling, which writes the same; a JSON file an image."""

from __future__ import annotations

import json
import math
from base64 import b64decode
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.images import Limits, to_rgb
from roadeval.logs.truth import drawn

SMALLEST: Final = 64
"""Area of an outline that is written, in quarters of a pixel."""
HOLE: Final = "other"
_LINES: Final = ("point", "points", "line", "linestrip")
_CORNERS: Final = ("polygon", "rectangle", "rotation", "oriented_rectangle", "quadrilateral")


def _is_labelme(_: Path, content: Any) -> bool:
    return isinstance(content, dict) and {"shapes", "imageWidth", "imageHeight"} <= content.keys()


def _labelme(
    path: Path, content: Mapping[str, Any], _: drawn.Size | None
) -> Iterator[drawn.Drawing]:
    areas = (shape for shape in content["shapes"] if shape.get("shape_type") not in _LINES)
    size = drawn.size_in(content, "imageWidth", "imageHeight")
    yield drawn.Drawing(str(path), size, map(_shape, areas))


def _shape(shape: Mapping[str, Any]) -> drawn.Shape:
    label, points = shape["label"], drawn.flat(shape["points"])
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
            area = drawn.Proposal("", pixels)
            return drawn.Runs(label, area.runs(), (int(left), int(top), *area.size))
        case other, _:
            return drawn.Undrawn(label, f"{other} of {len(points) // 2} points")


def _as_labelme(proposals: Sequence[drawn.Proposal]) -> dict[str, bytes]:
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


def _outlines(proposal: drawn.Proposal) -> Iterator[tuple[str, list[list[float]]]]:
    """Yield outlines with few points, within a pixel; small holes and islands are left out."""
    import cv2

    road = np.pad(proposal.road.astype(np.uint8).repeat(2, 0).repeat(2, 1), 1)
    rings, parents = cv2.findContours(road, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    inner = np.zeros(0) if parents is None else parents[0, :, 3] >= 0
    for place in np.argsort(inner, kind="stable").tolist():
        ring = cv2.approxPolyDP(rings[place], 2.0, closed=True)[:, 0, :]
        if len(ring) > 2 and cv2.contourArea(rings[place]) >= SMALLEST:
            yield HOLE if inner[place] else drawn.PROPOSED, ((ring - 0.5) / 2).tolist()


LABELME: Final = drawn.LabelFormat("LabelMe", ".json", _is_labelme, _labelme, _as_labelme)
FORMATS: Final = (LABELME,)
