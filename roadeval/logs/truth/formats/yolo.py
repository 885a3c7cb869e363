"""Label format: YOLO segmentation, in a text file for each image; points are shares of its size.

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
"""The beginning of a line of labels, which lines with names of classes do not have; or no line."""


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
            flat = [float(share) * size[place % 2] for place, share in enumerate(shares)]
            label = str(int(label))
            if int(label) < 0 or len(flat) % 2 or len(flat) < 4:
                raise ValueError
        except (ValueError, OverflowError) as error:
            raise BadMessage(f"line {number} is no class with an outline") from error
        if max(map(abs, map(float, shares))) > 2:  # shares somewhat above 1 are rounded
            raise BadMessage(f"line {number} has points that are no shares of the image's size")
        if len(flat) == 4:
            x, y, width, height = (number / 2 for number in flat)
            box = shapes.rectangle(
                label, 2 * x - width, 2 * y - height, 2 * x + width, 2 * y + height
            )
            yield shapes.Undrawn(label, "box without an outline", box)
        else:
            yield shapes.Outline(label, flat)


FORMAT: Final = shapes.LabelFormat(
    "YOLO segmentation", ".txt", lambda _, text: bool(_LINE.search(text)), read
)
