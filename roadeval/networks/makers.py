"""Settings and class names that a network's makers state: Ultralytics' and Hugging Face's."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from roadeval.networks.settings import NetSettings, NetworkError
from roadeval.runtime.documents import read_bounded, read_json

MODELS: Final = ("model.onnx", "onnx/model.onnx")
CONFIG: Final = "config.json"
PREPROCESSOR: Final = "preprocessor_config.json"
MOST: Final = 4 << 20
"""Greatest number of bytes of a JSON file."""
FILTERS: Final[Mapping[Any, Any]] = {2: True, 3: "bicubic"}
"""Values of ``antialias`` by the number of a filter in Pillow."""
UNFIT: Final = ("do_center_crop", "do_pad", "keep_aspect_ratio")
"""Steps of preprocessing after which the input shows a part of the frame, or more than it."""


def find_network(folder: Path) -> Path:
    """Return the ONNX file of a folder; a `NetworkError` if there is none."""
    for name in MODELS:
        if (folder / name).is_file():
            return folder / name
    problem = f"a folder without {' or '.join(MODELS)}"
    raise NetworkError(problem, where=folder, remedy=f"export the network as ONNX to {MODELS[0]}")


@contextmanager
def reading(path: Path, problem: str) -> Iterator[None]:
    """Turn an error of reading inside the block into a `NetworkError` with one line."""
    try:
        yield
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        if isinstance(error, ValidationError):
            first = error.errors(include_url=False)[0]
            reason = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
        raise NetworkError(f"{problem}: {reason}", where=path) from error


def read_documents(folder: Path) -> tuple[bytes, bytes]:
    """Return the bytes of the JSON files; a `NetworkError` if one cannot be read."""
    contents = []
    for name in (CONFIG, PREPROCESSOR):
        with reading(folder / name, "a folder of Hugging Face needs it, and it cannot be read"):
            contents.append(read_bounded(folder / name, MOST))
    return contents[0], contents[1]


def is_ultralytics(metadata: Mapping[str, str]) -> bool:
    """Return whether a file comes from Ultralytics, by its metadata."""
    return metadata.get("author") == "Ultralytics"


def names_in(metadata: Mapping[str, str]) -> dict[int, str]:
    """Return the names of classes by number, from the metadata of an ONNX file."""
    try:
        names = dict(ast.literal_eval(metadata.get("names", "{}")))
        return {int(number): str(name) for number, name in names.items()}
    except (ValueError, SyntaxError, TypeError, ArithmeticError, MemoryError, RecursionError):
        return {}


def settings_in(metadata: Mapping[str, str]) -> NetSettings:
    """Return the settings in Ultralytics' metadata, a letterbox and its size; else none."""
    if not is_ultralytics(metadata):
        return NetSettings()
    stated = NetSettings(resize="letterbox")
    with suppress(LookupError, ValueError, TypeError, RecursionError):
        height, width = json.loads(metadata["imgsz"])
        return replace(stated, size=(width, height), stride=json.loads(metadata["stride"]))
    return stated


def class_names(folder: Path, content: bytes) -> dict[int, str]:
    """Return the names of classes by number, without names such as ``LABEL_3``."""
    with reading(folder / CONFIG, "damaged"):
        config = _table(content)
        named = TypeAdapter(dict[str, int]).validate_python(config.get("label2id") or {})
        by_number = config.get("id2label") or {number: name for name, number in named.items()}
        names = TypeAdapter(dict[int, str]).validate_python(by_number)
    return {number: name for number, name in names.items() if name != f"LABEL_{number}"}


def input_settings(folder: Path, content: bytes) -> NetSettings:
    """Return the settings of the input, as the makers' preprocessing makes it."""
    path = folder / PREPROCESSOR
    with reading(path, "damaged"):
        made = _table(content)
    if step := next((name for name in UNFIT if made.get(name)), ""):
        problem = f"has {step}, after which the network does not see the frame as it is"
        raise NetworkError(problem, where=path, remedy=f"set {step} to false")
    values: dict[str, Any] = {"layout": "NCHW", "resize": "stretch"}
    kind = str(made.get("image_processor_type", made.get("feature_extractor_type")))
    if made.get("do_resize", True):
        if (resample := made.get("resample", 2)) not in (2, 3):
            problem = f"asks for resample {resample!r}; only 2 and 3 are known"
            raise NetworkError(problem, where=path, remedy="set resample to 2, the bilinear filter")
        values["antialias"] = FILTERS[resample]
        size = made.get("size")
        # Otherwise the size is not stated, or depends on the frame.
        if isinstance(size, dict) and {"width", "height"} <= size.keys():
            values["size"] = [size["width"], size["height"]]
        elif isinstance(size, int) and "Segformer" in kind:
            values["size"] = [size, size]
    values["scale"] = made.get("rescale_factor", 1 / 255) if made.get("do_rescale", True) else 1.0
    # MobileViT's processor has a mean, and by default does not use it.
    if made.get("do_normalize", "MobileViT" not in kind):
        for key, name in (("image_mean", "mean"), ("image_std", "deviation")):
            if key not in made:
                raise NetworkError(f"lacks {key}", where=path, remedy="add it")
            values[name] = made[key] if isinstance(made[key], list) else [made[key]]
    if made.get("do_flip_channel_order"):
        values["channels"] = "bgr"
    with reading(path, "damaged"):
        return NetSettings(**values)


def _table(content: bytes) -> dict[str, Any]:
    """Return the table of a JSON file; a ValueError if it is damaged."""
    if not isinstance(table := read_json(content), dict):
        raise ValueError("it holds no table")
    return table
