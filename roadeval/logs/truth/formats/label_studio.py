"""Label format: Label Studio's JSON and JSON-MIN; points are percents of the image's size."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote

from roadeval.logs.errors import LogError
from roadeval.logs.truth.drawn import Drawing, LabelFormat, Outline, Shape, Size, rectangle

_UPLOADED: Final = re.compile(r"(?:.*[/=])?(?:[0-9a-f]{8}-)?(.+)")
"""An image's name, with the path and the eight digits that an upload puts before it."""
_AREAS: Final = "polygonlabels", "rectanglelabels"
_UNREAD: Final = "brushlabels", "ellipselabels", "bitmasklabels"


def _holds(_: Path, content: Any) -> bool:
    first = content[0] if isinstance(content, list) and content else None
    return isinstance(first, dict) and ("annotations" in first or "annotation_id" in first)


def _read(path: Path, content: list[Mapping[str, Any]], _: Size | None) -> Iterator[Drawing]:
    for task in content:
        if "annotations" in task:
            results = [each["result"] for each in task["annotations"] if not _is_void(each)]
            values = [[{**r, **r["value"]} for r in result if "value" in r] for result in results]
        else:
            values = [[r for v in task.values() if isinstance(v, list) for r in v]]
        for shapes in values:  # of each annotator
            areas = [each for each in shapes if {*_AREAS, *_UNREAD} & each.keys()]
            size = (areas[0]["original_width"], areas[0]["original_height"]) if areas else None
            yield Drawing(_image(task), size, [_shape(each, path) for each in areas])


def _is_void(annotation: Mapping[str, Any]) -> bool:
    return bool(annotation.get("was_cancelled"))


def _image(task: Mapping[str, Any]) -> str:
    """Return the name of a task's image: the first of its data that names a file."""
    texts = [text for text in task.get("data", task).values() if isinstance(text, str)]
    name = next((text for text in texts if re.search(r"\.\w{3,4}$", text)), None)
    if name is None:
        raise ValueError("a task without an image")
    found = _UPLOADED.fullmatch(unquote(name))
    return found[1] if found else name


def _shape(value: Mapping[str, Any], path: Path) -> Shape:
    kind = next(name for name in (*_AREAS, *_UNREAD) if name in value)
    if kind in _UNREAD:
        raise LogError(
            f"{path}: it holds {kind}, which roadeval does not read; export masks as PNG"
        )
    width, height = value["original_width"], value["original_height"]
    (label,) = map(str, value[kind])
    if kind == "polygonlabels":
        flat = [n for x, y in value["points"] for n in (x * width / 100, y * height / 100)]
        return Outline(label, flat)
    if value.get("rotation"):
        raise LogError(f"{path}: it holds a turned rectangle, which roadeval does not read")
    left, top = value["x"] * width / 100, value["y"] * height / 100
    return rectangle(
        label, left, top, left + value["width"] * width / 100, top + value["height"] * height / 100
    )


FORMAT = LabelFormat("Label Studio", ".json", _holds, _read)
