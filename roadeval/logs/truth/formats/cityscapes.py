"""Label format: Cityscapes' polygons from back to front, in a JSON file for each image."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from roadeval.logs.truth import drawn


def _read_cityscapes(
    path: Path, content: Mapping[str, Any], _: drawn.Size | None
) -> Iterator[drawn.DrawnLabel]:
    shapes = (
        drawn.Outline(area["label"], drawn.flatten(area["polygon"]))
        for area in content["objects"]
        if not area.get("deleted")
    )
    yield drawn.DrawnLabel(str(path), drawn.size_in(content, "imgWidth", "imgHeight"), shapes)


FORMATS: Final = (
    drawn.LabelFormat(
        "Cityscapes", ".json", drawn.has_keys("imgWidth", "imgHeight", "objects"), _read_cityscapes
    ),
)
