"""Label format: LabelMe, and X-AnyLabeling, which writes the same: a JSON file an image."""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from roadeval.images import Limits, to_rgb
from roadeval.logs.errors import LogError
from roadeval.logs.truth.drawn import Drawing, LabelFormat, Outline, Runs, Shape, Size, rectangle

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
            height, width = pixels.shape
            changes = np.flatnonzero(np.diff(pixels.ravel(), prepend=False))
            lengths = np.diff(changes, prepend=0, append=pixels.size).tolist()
            return Runs(label, lengths, (int(points[0]), int(points[1]), width, height))
        case other, _:
            raise LogError(f"{path}: it holds a shape ({other}) that roadeval does not read")


FORMAT = LabelFormat("LabelMe", ".json", _holds, _read)
