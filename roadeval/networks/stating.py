"""Settings of a network with nothing left open: read from its file, or asked for in one line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, Literal

import numpy.typing as npt

from roadeval.networks import metadata
from roadeval.networks.loaded import Loaded
from roadeval.networks.onnx_file import OnnxFile, Tensor
from roadeval.networks.scores import as_scores
from roadeval.networks.settings import NetSettings
from roadeval.networks.values import channel_count, input_shape

FED: Final = frozenset({"float32", "float16", "float64", "uint8"})
"""Types of an input that takes an image."""
_COUNTS: Final = (1, 3)
"""Channels that an image can have."""


def stated(settings: NetSettings, loaded: Loaded) -> NetSettings:
    """Return settings in which every choice is stated.

    Raises
    ------
    NetworkError
        If the network cannot be used, or a choice cannot be read from its file: one line that asks
        for it and lists the network's inputs and outputs.
    """
    file = loaded.file
    settings = replace(settings, sha256=file.sha256, backend=loaded.backend_name)
    settings = _numbers(_input(settings, file), file)
    settings = replace(settings, outputs=_outputs(settings, file))
    assert settings.outputs is not None
    found = loaded.tried(input_shape(settings), settings.outputs)
    for name, array in zip(settings.outputs, found, strict=True):
        settings = _meaning(settings, file, name, array)
    return settings


def is_labels(output: npt.NDArray[Any]) -> bool:
    """Return whether an output holds classes themselves, and not scores of each."""
    return bool(output.dtype.kind in "iub")


# --- The input ------------------------------------------------------------------------------------


def _input(settings: NetSettings, file: OnnxFile) -> NetSettings:
    """State layout, channels and size."""
    if len(file.inputs) != 1:
        raise file.question("takes something else than one image, and nothing can be put there")
    only = file.inputs[0]
    if len(only.shape) != 4 or only.dtype not in FED:
        raise file.question("takes no image: that is four lengths of numbers")
    if only.shape[0] not in (None, 1):
        raise file.question(f"takes {only.shape[0]} images at once; export it for one")
    layout = settings.layout or _layout(only, file)
    _, *sizes = only.shape
    count, rows, columns = sizes if layout == "NCHW" else (sizes[2], sizes[0], sizes[1])
    channels = settings.channels or metadata.channel_order(file.metadata)
    settings = replace(
        settings,
        layout=layout,
        channels=channels or ("grey" if count == 1 else "rgb"),
        size=_size(settings, columns, rows, file),
    )
    if count not in (None, channel_count(settings)):
        raise file.question(f"its input has {count} channels, and {settings.channels} has others")
    return settings


def _layout(only: Tensor, file: OnnxFile) -> Literal["NCHW", "NHWC"]:
    if only.shape[1] in _COUNTS:
        return "NCHW"
    if only.shape[3] in _COUNTS:
        return "NHWC"
    raise file.question("say which of its input's lengths is that of channels: `net.layout`")


def _size(
    settings: NetSettings, columns: int | None, rows: int | None, file: OnnxFile
) -> tuple[int, int]:
    asked = settings.size or (columns, rows)
    width, height = asked
    if width is None or height is None:
        raise file.question(
            "takes images of any size: say which by `net.size`, width and height as [512, 256]"
        )
    if columns not in (None, width) or rows not in (None, height):
        raise file.question(f"takes no input of {width}x{height}: see `net.size`")
    return width, height


def _numbers(settings: NetSettings, file: OnnxFile) -> NetSettings:
    """State scale, mean and deviation."""
    whole = file.inputs[0].dtype == "uint8"
    told = metadata.pixel_range(file.metadata)
    scale, mean = told or (1.0 if whole else 1 / 255, 0.0)
    settings = replace(
        settings,
        scale=settings.scale or scale,
        mean=settings.mean or ((mean,) if settings.scale is None else (0.0,)),
        deviation=settings.deviation or (1.0,),
    )
    for name in ("mean", "deviation"):
        if len(getattr(settings, name)) not in (1, channel_count(settings)):
            raise file.error(
                f"`net.{name}` must hold one number, or one for each of the "
                f"{channel_count(settings)} channels"
            )
    return settings


# --- The outputs ----------------------------------------------------------------------------------


def _outputs(settings: NetSettings, file: OnnxFile) -> tuple[str, ...]:
    known = [output.name for output in file.outputs]
    if settings.outputs is None and len(known) > 1:
        raise file.question("gives several outputs: say which tell of road by `net.outputs`")
    for name in settings.outputs or ():
        if name not in known:
            raise file.question(f"has no output {name!r}: see `net.outputs`")
    return settings.outputs or (known[0],)


def _meaning(
    settings: NetSettings, file: OnnxFile, name: str, output: npt.NDArray[Any]
) -> NetSettings:
    """State what an output means."""
    assert settings.layout is not None
    assert settings.size is not None
    scores = as_scores(output, settings.layout)
    if scores is None or not _like(scores, settings.size):
        raise file.question(f"its output {name!r} is no map of the image, but {output.shape}")
    if is_labels(output):
        if len(scores) != 1:
            raise file.question(f"its output {name!r} holds whole numbers of {len(scores)} classes")
        road = _road(settings, file, None)
        return replace(settings, road=road, activation="none", decide="argmax")
    count = len(scores)
    decide = settings.decide or ("threshold" if count == 1 else "argmax")
    if decide == "argmax" and count == 1:
        raise file.question(
            f"its output {name!r} has one class, which beats no other: see `net.decide`"
        )
    made = file.makers.get(name, "").lower()
    usual: Literal["softmax", "sigmoid"] = "sigmoid" if count == 1 else "softmax"
    activation = settings.activation or ("none" if made in ("softmax", "sigmoid") else usual)
    settings = replace(settings, decide=decide, activation=activation)
    road = _road(settings, file, count)
    if decide == "argmax" and len(road) == count:
        raise file.question("all of its classes are road: see `net.road`")
    return replace(settings, road=road)


def _like(scores: npt.NDArray[Any], size: tuple[int, int]) -> bool:
    """Return whether a map has about the proportions of the input."""
    rows, columns = scores.shape[1:]
    return bool(abs(rows - size[1] * columns / size[0]) <= max(2.0, 0.1 * rows))


def _road(settings: NetSettings, file: OnnxFile, count: int | None) -> tuple[int, ...]:
    """Return the numbers of the classes that are road, of ``count``; None: of labels."""
    names = metadata.class_names(file.metadata)
    if settings.road is not None:
        road = tuple(_number(each, names, file) for each in settings.road)
    elif count in (1, 2):
        road = (count - 1,)
    else:
        road = metadata.road_classes(names)
    if not road:
        of = "" if count is None else f" of its {count}"
        listed = f", which are {_listed(names)}" if names else ""
        raise file.question(f"say which classes{of} are road by `net.road`, as [0]{listed}")
    if count is not None and max(road) >= count:
        raise file.question(f"has no class {max(road)}, but {count} from 0: see `net.road`")
    return road


def _number(named: int | str, names: dict[int, str], file: OnnxFile) -> int:
    if isinstance(named, int):
        return named
    found: Sequence[int] = [number for number, name in names.items() if name == named]
    if not found:
        known = f"it has {_listed(names)}" if names else "its file names none, so give numbers"
        raise file.question(f"has no class {named!r}; {known}: see `net.road`")
    return found[0]


def _listed(names: dict[int, str], most: int = 30) -> str:
    shown = [f"{number} {name}" for number, name in list(names.items())[:most]]
    return ", ".join(shown) + (", ..." if len(names) > most else "")
