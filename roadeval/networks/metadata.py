"""What a network's metadata tell: class names, the channels' order, their range, a licence.

The keys are those that exporters write: ``names`` (a dictionary in Python's or JSON's form, or a
list) and ONNX's own ``Image.BitmapPixelFormat`` and ``Image.NominalPixelRange``.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping
from typing import Any, Final, Literal

from roadeval.runtime.text import visible

NAMES: Final = ("names", "class_names", "classes", "labels")
LICENCES: Final = ("license", "licence")
ROAD_NAMES: Final = frozenset({"road", "drivable", "drivable area", "driveable area", "roadway"})
"""Names of classes that are road."""
LONGEST: Final = 100_000
"""Letters of a list of class names."""
QUOTED: Final = 1000
"""Letters of a licence that results quote."""
_ORDERS: Final[Mapping[str, Literal["rgb", "bgr", "grey"]]] = {
    "rgb8": "rgb",
    "bgr8": "bgr",
    "gray8": "grey",
}
_RANGES: Final[Mapping[str, tuple[float, float]]] = {
    "nominalrange_0_255": (1.0, 0.0),
    "normalized_0_1": (1 / 255, 0.0),
    "normalized_1_1": (2 / 255, 1.0),
}


def class_names(metadata: Mapping[str, str]) -> dict[int, str]:
    """Return the names of the classes by their numbers; none where the file lists none."""
    for key in NAMES:
        if key in metadata:
            return _numbered(_read(metadata[key]))
    return {}


def road_classes(names: Mapping[int, str]) -> tuple[int, ...]:
    """Return the classes whose names say that they are road."""
    return tuple(number for number, name in names.items() if name.strip().lower() in ROAD_NAMES)


def channel_order(metadata: Mapping[str, str]) -> Literal["rgb", "bgr", "grey"] | None:
    """Return the order of the channels; None where the file does not tell."""
    return _ORDERS.get(metadata.get("Image.BitmapPixelFormat", "").lower())


def pixel_range(metadata: Mapping[str, str]) -> tuple[float, float] | None:
    """Return scale and mean that bring 0..255 to the range of the input; None if it is not told."""
    return _RANGES.get(metadata.get("Image.NominalPixelRange", "").lower())


def licence(metadata: Mapping[str, str]) -> str | None:
    """Return what the file says of its licence, in one line; None where it says nothing."""
    for key in LICENCES:
        if text := " ".join(metadata.get(key, "").split()):
            return visible(text if len(text) <= QUOTED else f"{text[:QUOTED]}...")
    return None


def _read(text: str) -> Any:
    """Return the data that a text writes in JSON's or Python's form; None if it is neither."""
    if len(text) > LONGEST:
        return None
    for read in (json.loads, ast.literal_eval):
        try:
            return read(text)
        except (ValueError, SyntaxError, MemoryError, RecursionError):
            continue
    return None


def _numbered(value: Any) -> dict[int, str]:
    if isinstance(value, list | tuple):
        value = dict(enumerate(value))
    if not isinstance(value, dict):
        return {}
    return {int(key): visible(str(name)) for key, name in value.items() if str(key).isdecimal()}
