"""Label format: ASAM OpenLABEL, with 2D polygons of objects in numbered frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from roadeval.logs.errors import LogError
from roadeval.logs.truth.drawn import Drawing, LabelFormat, Outline, Shape, Size


def _holds(_: Path, content: Any) -> bool:
    return isinstance(content, dict) and "openlabel" in content


def _read(path: Path, content: Mapping[str, Any], size: Size | None) -> Iterator[Drawing]:
    known = content["openlabel"]
    types = {key: str(each["type"]) for key, each in known.get("objects", {}).items()}
    for number, frame in known.get("frames", {}).items():
        shapes: list[Shape] = []
        for key, each in frame.get("objects", {}).items():
            for polygon in each["object_data"].get("poly2d", ()):
                if polygon.get("mode", "MODE_POLY2D_ABSOLUTE") != "MODE_POLY2D_ABSOLUTE":
                    raise LogError(f"{path}: polygons of {polygon['mode']}, not of absolute points")
                if polygon.get("closed", True):
                    shapes.append(Outline(types[key], polygon["val"]))
        yield Drawing(str(int(number)), size, shapes)


FORMAT = LabelFormat("OpenLABEL", ".json", _holds, _read)
