"""Label format: YOLO segmentation, a text file an image; points are shares of its size."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from roadeval.logs.errors import LogError
from roadeval.logs.truth.drawn import Drawing, LabelFormat, Outline, Shape, Size
from roadeval.runtime.documents import TOML_BYTES, read_bounded

_LINE: Final = re.compile(r"\d+( +[-+.\deE]+){4,}\s*")
_LISTS: Final = ("classes.txt", "obj.names", "labels.txt")
"""Files with the name of a class in each line."""


def _holds(path: Path, content: str) -> bool:
    lines = [line for line in content.splitlines() if line.strip()]
    return path.name not in _LISTS and all(map(_LINE.fullmatch, lines))


def _read(path: Path, content: str, size: Size | None) -> Iterator[Drawing]:
    if size is None:
        raise LogError(f"{path}: its points are shares of the image's size, which is not known")
    names, shapes = _names(path.parent), list[Shape]()
    for line in content.splitlines():
        number, *shares = line.split()
        if len(shares) == 4:
            raise LogError(f"{path}: boxes, as for detection; road needs outlines")
        ring = [float(share) * size[place % 2] for place, share in enumerate(shares)]
        shapes.append(Outline(names.get(int(number), number), ring))
    yield Drawing(str(path), size, shapes)


@lru_cache(maxsize=8)
def _names(folder: Path) -> Mapping[int, str]:
    """Return the names of the classes, from the files beside the labels or up to two folders up."""
    for place in (folder, *folder.parents[:2]):
        for file in sorted(place.glob("*.y*ml")):
            if found := _names_in(file):
                return found
        for name in _LISTS:
            if (place / name).is_file():
                return dict(enumerate(read_bounded(place / name, TOML_BYTES).decode().splitlines()))
    return {}


def _names_in(file: Path) -> Mapping[int, str]:
    """Return ``names`` of a YAML file, a list or a table by numbers; nothing if it has none."""
    import yaml

    try:
        content: Any = yaml.safe_load(read_bounded(file, TOML_BYTES))
    except (yaml.YAMLError, RecursionError, ValueError, OSError):
        return {}
    names = content.get("names") if isinstance(content, dict) else None
    pairs = enumerate(names) if isinstance(names, list) else (names or {}).items()
    # A text of all else could be longer than any memory: YAML repeats by reference.
    return {int(number): name for number, name in pairs if isinstance(name, str)}


FORMAT = LabelFormat("YOLO segmentation", ".txt", _holds, _read)
