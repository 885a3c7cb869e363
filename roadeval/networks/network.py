"""A network's road mask of a frame; what its settings lack is read from its file, or asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Self

import cv2
import numpy as np

from roadeval.data import CERTAIN, Mask, Probability, Rgb
from roadeval.data.arrays import Values, sigmoid
from roadeval.networks.onnx_file import Array, OnnxFile, load, tried
from roadeval.networks.settings import MIB, NetSettings
from roadeval.runtime.text import visible


@dataclass(frozen=True, eq=False)
class Road:
    """The road of a frame by a network."""

    mask: Mask
    """``(H, W)`` uint8, 1 road."""
    codes: Probability
    """How probable road is, ``(H, W)`` uint16 codes 0..65535 that span 0..1."""
    graded: bool
    """Whether the mask is a threshold on them; otherwise the network gives classes alone, and they
    are 0 and 65535."""
    by_class: tuple[Probability, ...] = ()
    """The codes of each class of road, where there are several and they are graded."""


@dataclass(frozen=True, eq=False)
class Network:
    """A network with complete settings; any thread may call its methods."""

    settings: NetSettings
    file: OnnxFile
    shapes: tuple[tuple[int, ...], ...]
    """Of its outputs, which hold for every frame."""

    @classmethod
    def of(cls, settings: NetSettings) -> Self:
        """Open the network of some settings.

        A `NetworkError` if it cannot be used, or settings are missing that its file does not hold
        either.
        """
        file = load(settings)
        settings = completed(settings, file)
        return cls(settings, file, tuple(array.shape for array in _tried(settings, file)))

    def road(self, image: Rgb) -> Road:
        """Find the road in an ``(H, W, 3)`` uint8 RGB image.

        The probability of road is computed on the network's own grid and interpolated linearly to
        the frame's size; classes are brought there by the nearest pixel. With several outputs it is
        the greatest of theirs. A `NetworkError` if the network fails on it, or gives NaN or another
        shape than for other images.
        """
        settings = self.settings
        frame = image.shape[1], image.shape[0]
        values = input_values(placed(image, settings), settings, self.file.inputs[0].dtype)
        outputs = self.file.run(values, settings.outputs or (), settings.seconds)
        if (shapes := tuple(output.shape for output in outputs)) != self.shapes:
            raise self.file.error(
                f"its output's shape depends on the image: {shapes} instead of {self.shapes}; "
                "export it with a fixed one"
            )
        codes = np.maximum.reduce([self._codes(output, frame, settings) for output in outputs])
        limit = round((0.5 if settings.threshold is None else settings.threshold) * CERTAIN)
        mask = (codes > limit).astype(np.uint8)
        graded = not any(map(is_labels, outputs))
        alone = [replace(settings, road=(each,)) for each in settings.road or ()]
        if not graded or len(alone) * len(outputs) == 1:
            return Road(mask, codes, graded)
        planes = (self._codes(output, frame, each) for each in alone for output in outputs)
        return Road(mask, codes, graded, tuple(planes))

    def facts(self) -> Mapping[str, Any]:
        """Return facts about the network for results, beside its settings."""
        from onnxruntime import __version__

        named = self.file.metadata.get("license") or self.file.metadata.get("licence") or ""
        return {
            "onnxruntime": __version__,
            "file": self.file.path.name,
            "sha256": self.file.sha256,
            "licence": visible(" ".join(named.split())) or None,
            "inputs": [str(each) for each in self.file.inputs],
            "outputs": [str(each) for each in self.file.outputs],
            "road": [*map(str, self.settings.road or ())],
        }

    def _codes(self, output: Array, frame: Size, settings: NetSettings) -> Probability:
        scores = as_scores(output, settings.layout)
        assert scores is not None
        if is_labels(output):
            road = np.isin(scores[0], settings.road or ()).astype(np.uint16)
            return brought_back(CERTAIN * road, frame, settings, cv2.INTER_NEAREST_EXACT)
        shares = road_probability(scores.astype(np.float32, copy=False), settings)
        if np.isnan(scores).any() or not np.isfinite(shares).all():
            raise self.file.error("gives NaN")
        framed = brought_back(shares, frame, settings, cv2.INTER_LINEAR)
        return np.rint(np.clip(framed, 0, 1) * CERTAIN).astype(np.uint16)


def road_probability(scores: Values, settings: NetSettings) -> Values:
    """Compute how probable road is, ``(h, w)`` float32 in 0..1, from ``(C, h, w)`` float32 scores.

    For ``argmax`` it is road against the rest: the best class of road against the best other one,
    so that the mask is where it is above one half. For ``threshold`` it is the sum over the classes
    of road, and of a ``sigmoid`` the greatest of them.
    """
    chosen = np.isin(np.arange(len(scores)), settings.road or ())
    best: Values = scores[chosen].max(axis=0)
    if settings.decide == "argmax":
        other = scores[~chosen].max(axis=0)
        if settings.activation != "none":
            return sigmoid(best - other)
        total = best + other
        return np.divide(best, total, out=np.zeros_like(best), where=total > 0)
    if settings.activation == "sigmoid":
        return sigmoid(best)
    if settings.activation == "softmax":
        powers = np.exp(scores - scores.max(axis=0))
        return powers[chosen].sum(axis=0) / powers.sum(axis=0)
    return np.clip(scores[chosen].sum(axis=0), 0, 1)


GREY: Final = 114
"""Grey level around an image that does not fill a letterbox."""

Size = tuple[int, int]
"""Width and height."""


def inside(frame: Size, settings: NetSettings) -> tuple[slice, slice]:
    """Return the rows and columns of the input where a frame lies: in the middle."""
    assert settings.size is not None
    width, height = settings.size
    if settings.resize == "stretch":
        return slice(height), slice(width)
    ratio = min(width / frame[0], height / frame[1])
    inner = (max(1, round(side * ratio)) for side in frame)
    starts = [((whole - side) // 2, side) for whole, side in zip(settings.size, inner, strict=True)]
    columns, rows = (slice(start, start + side) for start, side in starts)
    return rows, columns


def placed(image: Rgb, settings: NetSettings) -> Rgb:
    """Return the input's pixels, ``(h, w, 3)`` uint8, of an ``(H, W, 3)`` uint8 frame."""
    assert settings.size is not None
    whole = np.full((*settings.size[::-1], 3), GREY, np.uint8)
    there = whole[inside((image.shape[1], image.shape[0]), settings)]
    there[...] = cv2.resize(image, there.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    return whole


def brought_back(plane: Array, frame: Size, settings: NetSettings, how: int) -> Array:
    """Bring an ``(h, w)`` map of the input, or a smaller one of all of it, to the frame's size."""
    if settings.resize != "stretch":
        whole = cv2.resize(plane, settings.size, interpolation=how)
        plane = np.ascontiguousarray(whole[inside(frame, settings)])
    return cv2.resize(plane, frame, interpolation=how)


def input_values(image: Rgb, settings: NetSettings, dtype: str) -> Array:
    """Compute ``(level scale - mean) / deviation`` of an ``(h, w, 3)`` uint8 RGB image.

    The image has the input's size, the settings are complete; whole numbers are rounded.
    """
    if settings.channels == "bgr":
        image = image[..., ::-1]
    elif settings.channels == "grey":
        image = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)[..., None]
    mean, deviation = (np.array(each, np.float64) for each in (settings.mean, settings.deviation))
    factor = (np.float64(settings.scale or 1) / deviation).astype(np.float32)
    values = image * factor - (mean / deviation).astype(np.float32)
    if np.dtype(dtype).kind == "u":
        values = np.clip(np.rint(values), 0, 255)
    planes = values.transpose(2, 0, 1) if settings.layout == "NCHW" else values
    return np.ascontiguousarray(planes[None], dtype)


FED: Final = frozenset({"float32", "float16", "float64", "uint8"})
"""Types of an input that takes an image."""


def completed(settings: NetSettings, file: OnnxFile) -> NetSettings:
    """Return settings without any missing value.

    A `NetworkError` if the network cannot be used, or a value cannot be read from its file: one
    line that asks for it and lists the network's inputs and outputs.
    """
    settings = _input(replace(settings, sha256=file.sha256), file)
    known = tuple(output.name for output in file.outputs)
    if settings.outputs is None and len(known) > 1:
        raise file.question("gives several outputs: name those that show road by `net.outputs`")
    outputs = settings.outputs or known
    if unknown := [name for name in outputs if name not in known]:
        raise file.question(f"has no output {unknown[0]!r}: see `net.outputs`")
    settings = replace(settings, outputs=outputs)
    arrays = _tried(settings, file)
    if len({is_labels(array) for array in arrays}) > 1:
        raise file.question("gives scores and classes: name outputs of one kind by `net.outputs`")
    for name, array in zip(outputs, arrays, strict=True):
        settings = _meaning(settings, file, name, array)
    return settings


def _tried(settings: NetSettings, file: OnnxFile) -> list[Array]:
    limits = settings.seconds, settings.megabytes * MIB
    return tried(file, settings.input_shape, settings.outputs or (), *limits)


def is_labels(output: Array) -> bool:
    """Return whether an output holds classes themselves, and not scores of each."""
    return bool(output.dtype.kind in "iub")


def as_scores(output: Array, layout: str | None) -> Array | None:
    """Return an output as classes, rows and columns; None where it is no map of the image.

    It is of one image, ``(1, C, h, w)``, or ``(1, h, w, C)`` where the input's layout is ``NHWC``,
    or without the length of 1, or without classes.
    """
    array = output[0] if output.ndim > 2 and len(output) == 1 else output
    if array.ndim == 3 and layout == "NHWC" and len(array) != 1:
        array = array.transpose(2, 0, 1)
    if array.ndim == 2:
        array = array[None]
    return array if array.ndim == 3 and len(array) and min(array.shape[1:]) > 1 else None


def _input(settings: NetSettings, file: OnnxFile) -> NetSettings:
    """Complete all that is said of the input."""
    shape = file.inputs[0].shape if len(file.inputs) == 1 else ()
    if len(shape) != 4 or shape[0] not in (None, 1) or file.inputs[0].dtype not in FED:
        raise file.question("takes no image: that is one input of four lengths, the first one 1")
    layout = settings.layout or ("NCHW" if shape[1] in (1, 3) else "NHWC")
    count, rows, columns = shape[1:] if layout == "NCHW" else (shape[3], shape[1], shape[2])
    if settings.layout is None and count not in (1, 3):
        raise file.question("give the order of its input's lengths by `net.layout`")
    width, height = settings.size or (columns, rows)
    if width is None or height is None:
        raise file.question(
            "takes images of any size: give width and height by `net.size`, as [512, 256]"
        )
    if columns not in (None, width) or rows not in (None, height):
        raise file.question(f"takes no input of {width}x{height}: see `net.size`")
    settings = replace(
        settings,
        layout=layout,
        channels=settings.channels or ("grey" if count == 1 else "rgb"),
        size=(width, height),
        scale=settings.scale or (1.0 if file.inputs[0].dtype == "uint8" else 1 / 255),
        mean=settings.mean or (0.0,),
        deviation=settings.deviation or (1.0,),
    )
    if count not in (None, own := settings.channel_count):
        raise file.question(f"its input has {count} channels, and {settings.channels} has {own}")
    for name in ("mean", "deviation"):
        if len(getattr(settings, name)) not in (1, own):
            raise file.error(
                f"`net.{name}` must hold one number, or one for each of {own} channels"
            )
    return settings


def _meaning(settings: NetSettings, file: OnnxFile, name: str, output: Array) -> NetSettings:
    """Complete what an output means."""
    assert settings.size is not None
    width, height = settings.size
    scores = as_scores(output, settings.layout)
    count, rows, columns = (0, 0, 0) if scores is None else scores.shape
    # It has about the proportions of the input, and no more than one class of whole numbers.
    is_map = rows and abs(rows - height * columns / width) <= max(2.0, 0.1 * rows)
    if not is_map or (is_labels(output) and count != 1):
        raise file.question(f"its output {name!r} is no map of the image, but {output.shape}")
    made: dict[str, Any] = {"activation": "none", "decide": "argmax"}
    if is_labels(output) and settings.threshold is not None:
        raise file.question(f"its output {name!r} is of classes alone: leave `net.threshold` out")
    if not is_labels(output):
        is_probability = file.makers.get(name, "").lower() in ("softmax", "sigmoid")
        usual = "none" if is_probability else "sigmoid" if count == 1 else "softmax"
        above = settings.threshold is not None or count == 1
        made = {
            "activation": settings.activation or usual,
            "decide": settings.decide or ("threshold" if above else "argmax"),
            "threshold": 0.5 if settings.threshold is None else settings.threshold,
        }
    road = settings.road or ((count - 1,) if count <= 2 and not is_labels(output) else ())
    if not road:
        of = "" if is_labels(output) else f" of its {count}"
        raise file.question(f"give the numbers of the classes{of} that are road by `net.road`")
    if not is_labels(output):
        if max(road) >= count:
            raise file.question(f"has no class {max(road)}, but {count} from 0: see `net.road`")
        if made["decide"] == "argmax" and len(road) == count:
            raise file.question(
                f"all classes of its output {name!r} are road, which then beat no other: see "
                "`net.road` and `net.decide`"
            )
    return replace(settings, road=road, **made)
