"""A network's road mask of a frame; what its settings lack is read from its file, or asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final, Literal, Self

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import CERTAIN, Mask, Probability, Rgb
from roadeval.data.arrays import Values, sigmoid
from roadeval.networks.onnx_file import OnnxFile, load
from roadeval.networks.settings import NetSettings
from roadeval.runtime.text import visible


@dataclass(frozen=True, slots=True, eq=False)
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


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A network with complete settings; any thread may call its methods."""

    settings: NetSettings
    file: OnnxFile

    @classmethod
    def of(cls, settings: NetSettings) -> Self:
        """Open the network of some settings.

        A `NetworkError` if it cannot be used, or settings are missing that its file does not hold
        either.
        """
        file = load(settings)
        return cls(completed(settings, file), file)

    def road(self, image: Rgb) -> Road:
        """Find the road in an ``(H, W, 3)`` uint8 RGB image.

        The probability of road is computed on the network's own grid and interpolated linearly to
        the frame's size; classes are brought there by the nearest pixel. With several outputs it is
        the greatest of theirs. A `NetworkError` if the network fails on it, or gives NaN.
        """
        settings = self.settings
        assert settings.size is not None
        height, width = image.shape[:2]
        place = placement((width, height), settings.size, settings.resize)
        values = input_values(place.image(image), settings, self.file.inputs[0].dtype)
        outputs = self.file.run(values, settings.outputs or ())
        codes = np.maximum.reduce([self._codes(output, place, settings) for output in outputs])
        limit = round((0.5 if settings.decide == "argmax" else settings.threshold) * CERTAIN)
        mask = (codes > limit).astype(np.uint8)
        graded = not any(map(is_labels, outputs))
        classes = settings.road or ()
        if not graded or len(classes) * len(outputs) == 1:
            return Road(mask, codes, graded)
        alone = [replace(settings, road=(each,)) for each in classes]
        return Road(
            *(mask, codes, graded),
            tuple(self._codes(output, place, each) for each in alone for output in outputs),
        )

    def facts(self) -> Mapping[str, Any]:
        """Return facts about the network for results, beside its settings."""
        from onnxruntime import __version__

        return {
            "onnxruntime": __version__,
            "file": self.file.path.name,
            "sha256": self.file.sha256,
            "licence": licence(self.file.metadata),
            "inputs": [str(each) for each in self.file.inputs],
            "outputs": [str(each) for each in self.file.outputs],
            "road": [*map(str, self.settings.road or ())],
        }

    def _codes(
        self, output: npt.NDArray[Any], place: Placement, settings: NetSettings
    ) -> Probability:
        scores = as_scores(output, settings.layout)
        assert scores is not None
        if is_labels(output):
            road = np.isin(scores[0], settings.road or ()).astype(np.uint16)
            return place.back(CERTAIN * road, exact=True)
        shares = road_probability(scores.astype(np.float32), settings)
        if not np.isfinite(shares).all():
            raise self.file.error("gives NaN")
        framed = np.clip(place.back(shares, exact=False), 0, 1)
        return np.rint(framed * np.float32(CERTAIN)).astype(np.uint16)


def road_probability(scores: Values, settings: NetSettings) -> Values:
    """Compute how probable road is, ``(h, w)`` float32 in 0..1, from ``(C, h, w)`` float32 scores.

    For ``argmax`` it is road against the rest: the best class of road against the best other one,
    so that the mask is where it is above one half. For ``threshold`` it is the sum over the classes
    of road, and of a ``sigmoid`` the greatest of them.
    """
    chosen = np.zeros(len(scores), np.bool_)
    chosen[list(settings.road or ())] = True
    best: Values = scores[chosen].max(axis=0)
    if settings.decide == "argmax":
        other = scores[~chosen].max(axis=0)
        if settings.activation != "none":
            return sigmoid(best - other)
        with np.errstate(invalid="ignore"):
            share: Values = best / (best + other)
        return np.where(best + other > 0, share, 0.0).astype(np.float32)
    if settings.activation == "sigmoid":
        return sigmoid(best)
    if settings.activation == "softmax":
        powers = np.exp(scores - scores.max(axis=0))
        share = powers[chosen].sum(axis=0) / powers.sum(axis=0)
    else:
        share = np.clip(scores[chosen].sum(axis=0), 0, 1)
    return share


GREY: Final = 114
"""Grey level around an image that does not fill a letterbox."""

Plane = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Placement:
    """Where frames of one size lie in a network's input; sizes are width and height."""

    frame: tuple[int, int]
    size: tuple[int, int]
    inner: tuple[int, int]
    """Size that the frame is brought to."""

    def image(self, image: Rgb) -> Rgb:
        """Return the input's pixels, ``(h, w, 3)`` uint8, of an ``(H, W, 3)`` uint8 frame."""
        small: Rgb = cv2.resize(image, self.inner, interpolation=cv2.INTER_LINEAR)
        if self.inner == self.size:
            return small
        whole = np.full((*self.size[::-1], 3), GREY, np.uint8)
        whole[self._inside()] = small
        return whole

    def back(self, plane: Plane, *, exact: bool) -> Plane:
        """Bring an ``(h, w)`` map of the input, or a smaller one of all of it, to the frame's size.

        Interpolated linearly, or if ``exact`` by the nearest pixel, as for labels.
        """
        how = cv2.INTER_NEAREST_EXACT if exact else cv2.INTER_LINEAR
        if self.inner != self.size:
            whole = cv2.resize(plane, self.size, interpolation=how)
            plane = np.ascontiguousarray(whole[self._inside()])
        framed: Plane = cv2.resize(plane, self.frame, interpolation=how)
        return framed

    def _inside(self) -> tuple[slice, slice]:
        """Return the rows and columns of the input where the frame lies: in the middle."""
        (left, top), (width, height) = np.subtract(self.size, self.inner) // 2, self.inner
        return slice(top, top + height), slice(left, left + width)


@lru_cache(maxsize=16)
def placement(frame: tuple[int, int], size: tuple[int, int], resize: str) -> Placement:
    """Place frames of a width and height in an input of a size, see `NetSettings.resize`."""
    if resize == "stretch":
        return Placement(frame, size, size)
    ratio = min(whole / side for whole, side in zip(size, frame, strict=True))
    width, height = (max(1, round(side * ratio)) for side in frame)
    return Placement(frame, size, (width, height))


def input_values(image: Rgb, settings: NetSettings, dtype: str) -> npt.NDArray[Any]:
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
    kind = np.dtype(dtype)
    if kind.kind in "iu":
        limits = np.iinfo(kind)
        values = np.clip(np.rint(values), limits.min, limits.max)
    planes = values.transpose(2, 0, 1) if settings.layout == "NCHW" else values
    return np.ascontiguousarray(planes[None], kind)


FED: Final = frozenset({"float32", "float16", "float64", "uint8"})
"""Types of an input that takes an image."""
QUOTED: Final = 1000
"""Letters of a licence that results quote."""


def completed(settings: NetSettings, file: OnnxFile) -> NetSettings:
    """Return settings without any missing value.

    A `NetworkError` if the network cannot be used, or a value cannot be read from its file: one
    line that asks for it and lists the network's inputs and outputs.
    """
    settings = replace(settings, sha256=file.sha256)
    settings = _numbers(_input(settings, file), file)
    known = tuple(output.name for output in file.outputs)
    if settings.outputs is None and len(known) > 1:
        raise file.question("gives several outputs: name those that show road by `net.outputs`")
    outputs = settings.outputs or known
    for name in outputs:
        if name not in known:
            raise file.question(f"has no output {name!r}: see `net.outputs`")
    settings = replace(settings, outputs=outputs)
    for name, array in zip(outputs, file.tried(settings.input_shape, outputs), strict=True):
        settings = _meaning(settings, file, name, array)
    return settings


def licence(metadata: Mapping[str, str]) -> str | None:
    """Return the file's licence in one line; None if it names none."""
    text = " ".join((metadata.get("license") or metadata.get("licence") or "").split())
    return visible(text if len(text) <= QUOTED else f"{text[:QUOTED]}...") if text else None


def is_labels(output: npt.NDArray[Any]) -> bool:
    """Return whether an output holds classes themselves, and not scores of each."""
    return bool(output.dtype.kind in "iub")


def as_scores(output: npt.NDArray[Any], layout: str | None) -> npt.NDArray[Any] | None:
    """Return an output as classes, rows and columns; None where it is no map of the image.

    It is of one image, ``(1, C, h, w)``, or ``(1, h, w, C)`` where the input's layout is ``NHWC``,
    or without the length of 1, or without classes.
    """
    array = output[0] if output.ndim > 2 and len(output) == 1 else output
    if array.ndim == 3 and layout == "NHWC" and len(array) != 1:
        array = array.transpose(2, 0, 1)
    if array.ndim == 2:
        array = array[None]
    return array if array.ndim == 3 and min(array.shape[1:]) > 1 else None


def _input(settings: NetSettings, file: OnnxFile) -> NetSettings:
    """Complete layout, channels and size."""
    shape = file.inputs[0].shape if len(file.inputs) == 1 else ()
    if len(shape) != 4 or shape[0] not in (None, 1) or file.inputs[0].dtype not in FED:
        raise file.question("takes no image: that is one input of four lengths, the first one 1")
    layout = settings.layout or ("NCHW" if shape[1] in (1, 3) else "NHWC")
    _, count, rows, columns = shape if layout == "NCHW" else (1, shape[3], shape[1], shape[2])
    if settings.layout is None and count not in (1, 3):
        raise file.question("give the order of its input's lengths by `net.layout`")
    width, height = settings.size or (columns, rows)
    if width is None or height is None:
        raise file.question(
            "takes images of any size: give width and height by `net.size`, as [512, 256]"
        )
    if columns not in (None, width) or rows not in (None, height):
        raise file.question(f"takes no input of {width}x{height}: see `net.size`")
    channels = settings.channels or ("grey" if count == 1 else "rgb")
    settings = replace(settings, layout=layout, channels=channels, size=(width, height))
    if count not in (None, settings.channel_count):
        raise file.question(
            f"its input has {count} channels, and {channels} has {settings.channel_count}"
        )
    return settings


def _numbers(settings: NetSettings, file: OnnxFile) -> NetSettings:
    """Complete scale, mean and deviation."""
    settings = replace(
        settings,
        scale=settings.scale or (1.0 if file.inputs[0].dtype == "uint8" else 1 / 255),
        mean=settings.mean or (0.0,),
        deviation=settings.deviation or (1.0,),
    )
    for name in ("mean", "deviation"):
        if len(getattr(settings, name)) not in (1, settings.channel_count):
            raise file.error(
                f"`net.{name}` must hold one number, or one for each of the "
                f"{settings.channel_count} channels"
            )
    return settings


def _meaning(
    settings: NetSettings, file: OnnxFile, name: str, output: npt.NDArray[Any]
) -> NetSettings:
    """Complete what an output means."""
    assert settings.size is not None
    width, height = settings.size
    scores = as_scores(output, settings.layout)
    count, rows, columns = (0, 0, 0) if scores is None else scores.shape
    # It has about the proportions of the input, and no more than one class of whole numbers.
    is_map = rows and abs(rows - height * columns / width) <= max(2.0, 0.1 * rows)
    if not is_map or (is_labels(output) and count != 1):
        raise file.question(f"its output {name!r} is no map of the image, but {output.shape}")
    if is_labels(output):
        road = _road(settings, file, None)
        return replace(settings, road=road, activation="none", decide="argmax")
    decide = settings.decide or ("threshold" if count == 1 else "argmax")
    if decide == "argmax" and count == 1:
        raise file.question(
            f"its output {name!r} has one class, which beats no other: see `net.decide`"
        )
    is_probability = file.makers.get(name, "").lower() in ("softmax", "sigmoid")
    usual: Literal["softmax", "sigmoid"] = "sigmoid" if count == 1 else "softmax"
    activation = settings.activation or ("none" if is_probability else usual)
    road = _road(settings, file, count)
    if decide == "argmax" and len(road) == count:
        raise file.question("all of its classes are road: see `net.road`")
    return replace(settings, road=road, activation=activation, decide=decide)


def _road(settings: NetSettings, file: OnnxFile, count: int | None) -> tuple[int, ...]:
    """Return the numbers of the classes that are road, of ``count``; None: of labels."""
    road = settings.road or ((count - 1,) if count in (1, 2) else ())
    if not road:
        of = "" if count is None else f" of its {count}"
        raise file.question(f"give the numbers of the classes{of} that are road by `net.road`")
    if count is not None and max(road) >= count:
        raise file.question(f"has no class {max(road)}, but {count} from 0: see `net.road`")
    return road
