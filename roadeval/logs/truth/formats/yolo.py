"""Label format: YOLO segmentation, a text file an image; points are shares of its size.

Classes have numbers; what they are called stands in files that differ from tool to tool.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from roadeval.logs.errors import LogError
from roadeval.logs.truth.drawn import Drawing, LabelFormat, Outline, Shape, Size

_LINE: Final = re.compile(r"\d+( +[-+.\deE]+){4,}\s*")


def _holds(_: Path, content: str) -> bool:
    lines = [line for line in content.splitlines() if line.strip()]
    return all(map(_LINE.fullmatch, lines))


def _read(path: Path, content: str, size: Size | None) -> Iterator[Drawing]:
    if size is None:
        raise LogError(f"{path}: its points are shares of the image's size, which is not known")
    shapes: list[Shape] = []
    for line in content.splitlines():
        number, *shares = line.split()
        if len(shares) == 4:
            raise LogError(f"{path}: boxes, as for detection; road needs outlines")
        ring = [float(share) * size[place % 2] for place, share in enumerate(shares)]
        shapes.append(Outline(str(int(number)), ring))
    yield Drawing(str(path), size, shapes)


FORMAT = LabelFormat("YOLO segmentation", ".txt", _holds, _read)
