"""Label format: Scalabel and BDD100K, polygons with curves or runs of pixels in JSON."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.logs.errors import BadMessage
from roadeval.logs.truth import shapes
from roadeval.logs.truth.formats.coco import run_lengths

_STEPS: Final = np.linspace(0, 1, 25)[1:, None]
"""Positions of points on a curve, from its beginning to its end."""


def _frames(content: Any) -> list[Mapping[str, Any]]:
    """Return the images of a file; an older file of BDD100K has one image, and its name."""
    if isinstance(content, dict) and isinstance(content.get("frames"), list):
        frames: list[Mapping[str, Any]] = content["frames"]
        return [{"name": content.get("name"), **frame} for frame in frames]
    return content if isinstance(content, list) else []


def holds(_: Path, content: Any) -> bool:
    """Return whether a file lists frames with labels."""
    return any("name" in frame and {"labels", "objects"} & {*frame} for frame in _frames(content))


def read(_path: Path, content: Any, _: shapes.Size | None) -> Iterator[shapes.DrawnLabel]:
    """Yield the label of each image."""
    config = content.get("config") if isinstance(content, dict) else None
    common = shapes.size_in((config or {}).get("imageSize") or {})
    for frame in _frames(content):
        size = shapes.size_in(frame.get("size") or {}) or common
        yield shapes.DrawnLabel(str(frame["name"]), size, _shapes(frame, size))


def _shapes(frame: Mapping[str, Any], size: shapes.Size | None) -> Iterator[shapes.Shape]:
    for part in frame.get("labels") or frame.get("objects") or ():
        label = part["category"]
        if (runs := part.get("rle")) is not None:
            yield run_lengths(label, runs["counts"], runs.get("size"), size)
        elif polygons := part.get("poly2d"):
            if not isinstance(polygons[0], dict):  # formerly points, each with its type
                types = "".join(point[2] for point in polygons)
                polygons = [{"vertices": [point[:2] for point in polygons], "types": types}]
            for polygon in polygons:
                if polygon.get("closed", not label.startswith("lane")):
                    ring = _ring(label, polygon["vertices"], polygon.get("types"))
                    yield shapes.Outline(label, ring)
        elif box := part.get("box2d"):
            corners = (box[name] for name in ("x1", "y1", "x2", "y2"))
            yield shapes.Undrawn(label, "box without an outline", shapes.rectangle(label, *corners))
        elif not {"box3d", "graph"} & part.keys():
            yield shapes.Undrawn(label, "label without an outline")


def _ring(label: str, points: Sequence[Sequence[float]], types: str | None) -> Sequence[float]:
    """Return the points of a polygon, with points on its curves.

    A ``C`` is a point of a cubic curve. Three in a row are two control points and the end, as in
    BDD100K's toolkit; two in a row are the control points before a corner, as in Scalabel.
    """
    if types is None or "C" not in types:
        return shapes.flatten(points)
    corners = np.array([*points, points[0]], np.float64)
    ring = [corners[0]]
    for part in re.finditer("L|CC[CL]?|.", types[1 : len(points)]):
        if part[0] == "L":
            ring.append(corners[part.end()])
        elif part[0].startswith("CC"):
            start, (one, two, end) = ring[-1], corners[part.start() + 1 :][:3]
            curve = start * (1 - _STEPS) ** 3 + 3 * one * _STEPS * (1 - _STEPS) ** 2
            ring += [*(curve + 3 * two * _STEPS**2 * (1 - _STEPS) + end * _STEPS**3)]
        else:
            raise BadMessage(f"a curve of {label} that has not two control points")
    return np.ravel(ring).tolist()


FORMAT: Final = shapes.LabelFormat("Scalabel or BDD100K", ".json", holds, read)
