"""Label format: Cityscapes' polygons from back to front, in a JSON file for each image."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from roadeval.logs.truth import shapes


def read(
    path: Path, content: Mapping[str, Any], _: shapes.Size | None
) -> Iterator[shapes.DrawnLabel]:
    """Yield the label of the file's image."""
    polygons = (
        shapes.Outline(area["label"], shapes.flatten(area["polygon"]))
        for area in content["objects"]
        if not area.get("deleted")
    )
    yield shapes.DrawnLabel(str(path), shapes.size_in(content, "imgWidth", "imgHeight"), polygons)


FORMAT: Final = shapes.LabelFormat(
    "Cityscapes", ".json", shapes.has_keys("imgWidth", "imgHeight", "objects"), read
)
