"""Label format: Label Studio's JSON and JSON-MIN; coordinates are percents of the image's size."""

from __future__ import annotations

import json
import re
from base64 import b64decode
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any, Final
from urllib.parse import SplitResult, parse_qs, unquote, urlsplit

import numpy as np

from roadeval.images.decoding import to_labels
from roadeval.images.formats import Limits
from roadeval.logs.errors import BadMessage
from roadeval.logs.truth import shapes

_UPLOADED: Final = re.compile(r"^[0-9a-f]{8}-(?=.)")
"""The hash that an upload adds before an image's name."""
_AREAS: Final = ("points", "height", "radiusX", "rle", "imageDataURL", "vertices")
"""Keys of the pixels of a region; a key point has none of them, and is left out."""
_TOOLS: Final = [f"{t}labels" for t in ("polygon", "rectangle", "ellipse", "brush", "bitmask")]
_UNREADABLE: Final = {"points": ()}
_OTHER_SIZE: Final = "a mask of {} for an image of another size"


def holds(_: Path, content: Any) -> bool:
    """Return whether a file is a list of tasks."""
    first = content[0] if isinstance(content, list) and content else None
    return isinstance(first, dict) and ("annotations" in first or "annotation_id" in first)


def read(
    _: Path, content: list[Mapping[str, Any]], size: shapes.Size | None
) -> Iterator[shapes.DrawnLabel]:
    """Yield the label of each image."""
    # An image may be in several tasks, and merged projects may have two tasks of one number.
    tasks: defaultdict[str, list[Mapping[str, Any]]] = defaultdict(list)
    sizes: dict[str, shapes.Size | None] = {}
    for task in content:
        annotations = task.get("annotations", [task]) or []
        regions: list[Mapping[str, Any]] = []
        with suppress(AttributeError, TypeError):
            regions = [region for annotation in annotations for region in _regions(annotation)]
        image = _image(task, regions)
        tasks[image] += annotations
        stated = (shapes.size_in(r, "original_width", "original_height") for r in regions)
        sizes[image] = sizes.get(image) or next(filter(None, stated), None)
    for image, annotations in tasks.items():
        yield shapes.DrawnLabel(image, sizes[image], _shapes(annotations, sizes[image] or size))


def _regions(annotation: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the regions of an annotation: its results, or all lists of a task in JSON-MIN."""
    if "result" not in annotation:
        lists = [values for values in annotation.values() if isinstance(values, list)]
        return [region for region in chain.from_iterable(lists) if isinstance(region, dict)]
    regions: list[Mapping[str, Any]] = []
    for region in annotation["result"]:
        has_value = isinstance(region, dict) and isinstance(region.get("value"), dict)
        if has_value and region["value"]:
            regions.append({**region, **region["value"]})
        elif not isinstance(region, dict) or region.get("type") != "relation":
            regions.append(_UNREADABLE)
    return regions


def _image(task: Mapping[str, Any], regions: Iterable[Mapping[str, Any]]) -> str:
    """Return the name of a task's image, from the field that the regions refer to if possible."""
    data = task.get("data", task)
    # A list has the pages of a task; regions on the first one have no index, or 0.
    fields = {
        name: [*text, ""][0] if isinstance(text, list) else text for name, text in data.items()
    }
    texts = {name: text for name, text in fields.items() if isinstance(text, str)}
    referred = [texts[name] for r in regions if (name := r.get("to_name")) in texts]
    files = [text for text in texts.values() if re.search(r"\.[a-zA-Z]\w{2,3}($|\?)", text)]
    others = [text for text in texts.values() if "/" in text]
    (address, *_) = [*referred, *files, *others]
    is_address = "?" in address or "://" in address
    parts = urlsplit(address) if is_address else SplitResult("", "", address, "", "")
    query = parse_qs(parts.query)
    # The query names a file of the server's own disk, or of a storage behind it.
    path = query["d"][0] if "d" in query else parts.path
    if "fileuri" in query:
        path = urlsplit(b64decode(query["fileuri"][0]).decode()).path
    *folders, name = unquote(path).strip("/").split("/")
    return "/".join([*([] if "upload" in folders else folders[-1:]), _UPLOADED.sub("", name)])


def _shapes(
    annotations: Sequence[Mapping[str, Any]], size: shapes.Size | None
) -> Iterator[shapes.Shape]:
    valid = [annotation for annotation in annotations if not annotation.get("was_cancelled")]
    valid = [valid[0]] if len(valid) == 1 else [a for a in valid if a.get("ground_truth")] or valid
    if len(valid) > 1:
        who = " and ".join(str(a.get("completed_by", a.get("annotator"))) for a in valid)
        raise BadMessage(
            f"it has {len(valid)} annotations (of annotators {who}): mark one of them as "
            "ground truth in Label Studio and export JSON, or delete the others"
        )
    # A region and its class may be two results of one id, or of one place if there are no ids.
    merged: dict[Any, dict[str, Any]] = {}
    for region in _regions(valid[0]) if valid else ():
        place = json.dumps([region.get(name) for name in ("x", *_AREAS)])
        merged.setdefault(region.get("id", place), {}).update(region)
    for region in merged.values():
        if region.get("vertices") is not None and not region.get("closed"):
            continue  # a line
        if any(region.get(name) is not None for name in _AREAS) or {*_TOOLS} & region.keys():
            yield _shape(region, size)


def _shape(region: Mapping[str, Any], size: shapes.Size | None) -> shapes.Shape:
    named = [v for k, v in region.items() if k.endswith("labels") and isinstance(v, list)]
    labels = [label for values in named for label in values]
    if len(labels) != 1:
        raise BadMessage(
            f"a region of {' and '.join(map(str, labels)) or 'no class'}: give it one class"
        )
    (label,) = labels
    if region.get("item_index"):
        raise BadMessage(f"a region of {label} on a further image of the same task")
    if size is None or region.get("image_rotation"):
        raise BadMessage(f"a region of {label} on an image that was turned, or of unknown size")
    across, down = size[0] / 100, size[1] / 100
    degrees = float(region.get("rotation") or 0)
    if "rle" in region:
        return _brushed(label, region["rle"], size)
    if "imageDataURL" in region:
        pixels = to_labels(b64decode(region["imageDataURL"].partition(",")[2]), Limits())
        if pixels.shape[1::-1] != size:
            raise BadMessage(_OTHER_SIZE.format(label))
        return shapes.runs_of(label, pixels.reshape(*pixels.shape[:2], -1).max(axis=2) > 0)
    if "vertices" in region:
        return _vector(label, region["vertices"], across, down)
    if "points" in region:
        return shapes.Outline(
            label, shapes.flatten((x * across, y * down) for x, y in region["points"])
        )
    x, y = region["x"] * across, region["y"] * down
    if "radiusX" in region:
        across, down = region["radiusX"] * across, region["radiusY"] * down
        return shapes.ellipse(label, x, y, across, down).rotate(degrees, (x, y))
    right, bottom = x + region["width"] * across, y + region["height"] * down
    # A rectangle turns about its first corner.
    return shapes.rectangle(label, x, y, right, bottom).rotate(degrees, (x, y))


def _vector(
    label: str, vertices: Sequence[Mapping[str, Any]], across: float, down: float
) -> shapes.Shape:
    """Return the area of a closed vector; ``across`` and ``down`` are one percent in pixels."""
    before = [vertex.get("prevPointId") for vertex in vertices[1:]]
    follows = [vertex.get("id") for vertex in vertices[:-1]]
    if any(vertex.get("isBezier") for vertex in vertices):
        return shapes.Undrawn(label, "vector with curves")
    if any(before) and before != follows:
        return shapes.Undrawn(label, "vector with branches")
    points = ((vertex["x"] * across, vertex["y"] * down) for vertex in vertices)
    return shapes.Outline(label, shapes.flatten(points))


def _brushed(label: str, numbers: Sequence[int], size: shapes.Size) -> shapes.Runs:
    """Return an area that was painted with the brush.

    The bytes are a stream of bits: 32 for the number of values, four a pixel; 5 for the width of a
    value less one; 4 for each of four lengths less one. Then come blocks: 1 bit whether one value
    is repeated; 2 bits that choose a length; a number of that length, the number of values less
    one; and the values. The fourth value of a pixel is its opacity.
    """
    bits = "".join(f"{number:08b}" for number in numbers)
    place = 0

    def read(width: int) -> int:
        nonlocal place
        place += width
        return int(bits[place - width : place], 2)

    total, width = read(32), read(5) + 1
    if total != 4 * size[0] * size[1]:
        raise BadMessage(_OTHER_SIZE.format(label))
    Limits().check(*size)
    lengths = [read(4) + 1 for _ in range(4)]
    values = np.zeros(total, np.uint8)
    start = 0
    while start < total:
        is_repeated = read(1)
        end = start + 1 + read(lengths[read(2)])
        values[start:end] = read(width) if is_repeated else [read(width) for _ in range(start, end)]
        start = end
    if start != total:
        raise BadMessage(f"a mask of {label} that does not fit its image")
    # A pixel at the edge belongs to the area if it is opaque by more than half of the greatest
    # opacity, which is below 255 if the SDK made it of truth values (1) or of contours (100).
    opacity = values.reshape(size[1], size[0], 4)[..., 3]
    return shapes.runs_of(label, opacity > opacity.max() // 2)


FORMAT: Final = shapes.LabelFormat("Label Studio", ".json", holds, read)
