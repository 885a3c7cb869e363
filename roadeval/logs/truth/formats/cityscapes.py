"""Label format: Cityscapes' polygons, a JSON file an image, in their order from back to front."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from roadeval.logs.truth import drawn


def _cityscapes(
    path: Path, content: Mapping[str, Any], _: drawn.Size | None
) -> Iterator[drawn.DrawnLabel]:
    shapes = (
        drawn.Outline(area["label"], drawn.flat(area["polygon"]))
        for area in content["objects"]
        if not area.get("deleted")
    )
    yield drawn.DrawnLabel(str(path), drawn.size_in(content, "imgWidth", "imgHeight"), shapes)


FORMATS: Final = (
    drawn.LabelFormat(
        "Cityscapes", ".json", drawn.has("imgWidth", "imgHeight", "objects"), _cityscapes
    ),
)
