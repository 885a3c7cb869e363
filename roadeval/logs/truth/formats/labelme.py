"""Label format: LabelMe, and X-AnyLabeling, which writes the same: a JSON file an image."""

from __future__ import annotations

import json
from base64 import b64decode
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

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

SMALLEST = 64
"""Area of an outline that is written, in quarters of a pixel."""
HOLE = "other"
NO_AREAS = ("point", "points", "line", "linestrip")


def _holds(_: Path, content: Any) -> bool:
    return isinstance(content, dict) and {"shapes", "imageWidth", "imageHeight"} <= content.keys()


def _read(path: Path, content: Mapping[str, Any], _: Size | None) -> Iterator[Drawing]:
    size = int(content["imageWidth"]), int(content["imageHeight"])
    shapes = [
        _shape(each, path)
        for each in content["shapes"]
        if each.get("shape_type", "polygon") not in NO_AREAS
    ]
    yield Drawing(str(path), size, shapes)


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
            raise LogError(f"{path}: it holds a shape ({other}) that roadeval does not read")


def _write(proposals: Sequence[Proposal]) -> dict[str, bytes]:
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
    links = parents[0] if parents is not None else ()
    order = sorted(range(len(rings)), key=lambda place: links[place][3] >= 0)
    for place in order:
        ring = cv2.approxPolyDP(rings[place], 2.0, closed=True)[:, 0, :]
        if len(ring) > 2 and cv2.contourArea(rings[place]) >= SMALLEST:
            label = PROPOSED if links[place][3] < 0 else HOLE
            yield label, ((ring - 0.5) / 2).tolist()


FORMAT = LabelFormat("LabelMe", ".json", _holds, _read, _write)
