"""Label format: YOLO segmentation, a text file an image; points are shares of the image's size.

Classes have numbers; their names are in other files, which differ from tool to tool.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.truth import shapes

_LINE: Final = re.compile(r"^\s*-?\d+[ \t]+[-+.\d]|\A\s*\Z", re.MULTILINE)
"""Matches a text with a line that begins like a label, unlike a list of classes, or no text."""


def read(path: Path, content: str, size: shapes.Size | None) -> Iterator[shapes.DrawnLabel]:
    """Yield the label of the file's image."""
    if size is None:
        raise LogError("its points are shares of the image's size, which is not known", where=path)
    yield shapes.DrawnLabel(str(path), size, _shapes(content, size))


def _shapes(content: str, size: shapes.Size) -> Iterator[shapes.Shape]:
    for number, line in enumerate(content.splitlines(), 1):
        if not line.strip():
            continue
        try:
            label, *shares = line.split()
            ring = [float(share) * size[place % 2] for place, share in enumerate(shares)]
            label = str(int(label))
            if int(label) < 0 or len(ring) % 2 or len(ring) < 4:
                raise ValueError
        except (ValueError, OverflowError) as error:
            raise BadMessage(f"line {number} is not a class with an outline") from error
        if max(map(abs, map(float, shares))) > 2:  # rounding makes shares a little more than 1
            raise BadMessage(f"line {number} has points that are not shares of the image's size")
        if len(ring) == 4:
            x, y, width, height = ring
            left, top = x - width / 2, y - height / 2
            box = shapes.rectangle(label, left, top, x + width / 2, y + height / 2)
            yield shapes.Undrawn(label, "box without an outline", box)
        else:
            yield shapes.Outline(label, ring)


FORMAT: Final = shapes.LabelFormat(
    "YOLO segmentation", ".txt", lambda _, text: bool(_LINE.search(text)), read
)
