"""Label format: COCO, polygons or runs of pixels in one JSON file."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.truth import shapes


def read(
    path: Path, content: Mapping[str, Any], _: shapes.Size | None
) -> Iterator[shapes.DrawnLabel]:
    """Yield the label of each image."""
    categories = _by_id(path, "category", content["categories"])
    names = {number: str(category["name"]) for number, category in categories.items()}
    images = _by_id(path, "image", content["images"])
    annotations = defaultdict(list)
    for annotation in content["annotations"]:
        if "segments_info" in annotation:
            remedy = "save its masks as PNG files, one a frame"
            raise LogError("COCO panoptic", where=path, remedy=remedy)
        annotations[annotation["image_id"]].append(annotation)
    for number in annotations.keys() - images.keys():
        raise LogError(f"annotations are of image {number}, which is not listed", where=path)
    for number, image in images.items():
        size = shapes.size_in(image)
        outlines = _shapes(annotations[number], names, size)
        yield shapes.DrawnLabel(str(image["file_name"]), size, outlines)


def _by_id(path: Path, what: str, listed: Iterable[Mapping[str, Any]]) -> dict[Any, Any]:
    """Return images or categories by their ids; a `LogError` if an id is used twice."""
    numbered: dict[Any, Mapping[str, Any]] = {}
    for entry in listed:
        if numbered.setdefault(entry["id"], entry) is not entry:
            problem = f"two entries have the {what} id {entry['id']}, so annotations are ambiguous"
            remedy = "merge the files by a tool that numbers them anew"
            raise LogError(problem, where=path, remedy=remedy)
    return numbered


def _shapes(
    annotations: Iterable[Mapping[str, Any]], names: Mapping[Any, str], size: shapes.Size | None
) -> Iterator[shapes.Shape]:
    for annotation in annotations:
        if (label := names.get(annotation["category_id"])) is None:
            raise BadMessage(f"an annotation of category {annotation['category_id']}, not listed")
        match annotation.get("segmentation"):
            case {"counts": counts, **rest}:
                yield run_lengths(label, counts, rest.get("size"), size)
            case [[_, _], *_] as points if all(len(point) == 2 for point in points):
                yield shapes.Outline(label, shapes.flatten(points))
            case [[*_], *_] as rings if any(rings):
                yield from (shapes.Outline(label, ring) for ring in rings if ring)
            case None | [] | [[]]:
                left, top, width, height = annotation.get("bbox") or (0, 0, 0, 0)
                corners = left, top, left + width, top + height
                box = shapes.rectangle(label, *corners) if width else None
                yield shapes.Undrawn(label, "box without an outline", box)
            case other:
                yield shapes.Outline(label, other)


def run_lengths(label: str, counts: Any, stated: Any, size: shapes.Size | None) -> shapes.Runs:
    """Return an area of runs; ``stated`` is the height and width beside them, if any."""
    if size is not None and stated is not None and (stated[1], stated[0]) != size:
        raise BadMessage(
            f"a mask of {label} that is {stated[1]}x{stated[0]}, on an image of {size[0]}x{size[1]}"
        )
    lengths = lengths_in(counts) if isinstance(counts, str) else counts
    return shapes.Runs(label, lengths, by_columns=True)


def lengths_in(text: str) -> Sequence[int]:
    """Return the lengths of runs from COCO's text.

    Each letter has five bits of a number, the lowest ones first. From the fourth number on it is
    the difference from the number two places before.
    """
    lengths: list[int] = []
    value = shift = 0
    for letter in text.encode():
        code = letter - 48
        value |= (code & 31) << shift
        shift += 5
        if code & 32 and shift < 60:  # numbers are not longer
            continue
        if code & 16:
            value -= 1 << shift
        lengths.append(value + (lengths[-2] if len(lengths) > 2 else 0))
        value = shift = 0
    return lengths


def as_coco(proposals: Sequence[shapes.Proposal]) -> dict[str, bytes]:
    """Return one file by its name, with a region of uncompressed runs for road in each image.

    Ignored pixels are a second region, of the class ``ignore``.
    """
    import cv2

    images, annotations = list[Any](), list[Any]()
    for number, proposal in enumerate(proposals, 1):
        width, height = proposal.size
        images.append({"id": number, "file_name": proposal.image, "width": width, "height": height})
        areas = [proposal.road]
        if proposal.ignored is not None and proposal.ignored.any():
            areas.append(proposal.ignored)
        for category, area in enumerate(areas, 1):
            box = list(cv2.boundingRect(area.view(np.uint8)))
            about = {"id": len(annotations) + 1, "image_id": number, "category_id": category}
            counts = proposal._replace(road=area).runs(by_columns=True)
            runs = {"size": [height, width], "counts": counts}
            shape = {"iscrowd": 1, "area": int(area.sum()), "bbox": box, "segmentation": runs}
            annotations.append({**about, **shape})
    content = {"images": images, "annotations": annotations}
    names = ["road", *["ignore"] * any(proposal.ignored is not None for proposal in proposals)]
    content["categories"] = [{"id": place, "name": name} for place, name in enumerate(names, 1)]
    return {"instances.json": json.dumps(content).encode()}


FORMAT: Final = shapes.LabelFormat(
    "COCO", ".json", shapes.has_keys("images", "annotations", "categories"), read
)
