"""Label format: COCO, with polygons or runs of pixels."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

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
)


def _holds(_: Path, content: Any) -> bool:
    keys = {"images", "annotations", "categories"}
    return isinstance(content, dict) and keys <= content.keys()


def _read(path: Path, content: Mapping[str, Any], _: Size | None) -> Iterator[Drawing]:
    names = {each["id"]: str(each["name"]) for each in content["categories"]}
    own = defaultdict(list)
    for annotation in content["annotations"]:
        own[annotation["image_id"]].append(annotation)
    for image in content["images"]:
        annotations = own.pop(image["id"], [])
        size = int(image["width"]), int(image["height"])
        if annotations and "segments_info" in annotations[0]:
            raise LogError(f"{path}: COCO panoptic; save its masks as PNG files, one a frame")
        shapes = [s for each in annotations for s in _shapes(each, names[each["category_id"]])]
        yield Drawing(str(image["file_name"]), size, shapes)
    if own:
        raise LogError(f"{path}: annotations are of image {next(iter(own))}, which is not listed")


def _shapes(annotation: Mapping[str, Any], label: str) -> Iterator[Shape]:
    match annotation.get("segmentation"):
        case {"counts": str(text)}:
            yield Runs(label, lengths_in(text), by_columns=True)
        case {"counts": counts}:
            yield Runs(label, counts, by_columns=True)
        case [*polygons]:
            yield from (Outline(label, ring) for ring in polygons)


def lengths_in(text: str) -> Sequence[int]:
    """Return the lengths of the runs that COCO writes as a text.

    A number has five bits in each letter, the lowest ones first, and from the fourth number on it
    is the difference from the last but one.
    """
    lengths: list[int] = []
    value = shift = 0
    for letter in text.encode():
        code = letter - 48
        value |= (code & 31) << shift
        shift += 5
        if code & 32 and shift < 60:  # no number is longer
            continue
        if code & 16:
            value -= 1 << shift
        lengths.append(value + (lengths[-2] if len(lengths) > 2 else 0))
        value = shift = 0
    return lengths


def _write(proposals: Sequence[Proposal]) -> dict[str, bytes]:
    """Return one file, with a region of uncompressed runs for each image."""
    images, annotations = [], []
    for number, each in enumerate(proposals, 1):
        width, height = each.size
        rows, columns = (np.flatnonzero(each.road.any(axis=axis)).tolist() for axis in (1, 0))
        box = [0, 0, 0, 0]
        if rows:
            left, top = columns[0], rows[0]
            box = [left, top, columns[-1] + 1 - left, rows[-1] + 1 - top]
        images.append({"id": number, "file_name": each.image, "width": width, "height": height})
        about = {"id": number, "image_id": number, "category_id": 1, "iscrowd": 1}
        runs = {"size": [height, width], "counts": each.runs(by_columns=True)}
        annotations.append(
            {**about, "area": int(each.road.sum()), "bbox": box, "segmentation": runs}
        )
    content = {"images": images, "annotations": annotations}
    content["categories"] = [{"id": 1, "name": PROPOSED}]
    return {"instances.json": json.dumps(content).encode()}


FORMAT = LabelFormat("COCO", ".json", _holds, _read, _write)
