"""A network's road mask of a frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, Self

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import Mask, Probability, Rgb
from roadeval.data.arrays import Values
from roadeval.networks.completion import (
    as_scores,
    class_names,
    completed,
    is_labels,
    licence,
)
from roadeval.networks.onnx_file import OnnxFile, load
from roadeval.networks.settings import NetSettings

FULL: Final = 65535
"""The code of a probability of 1."""


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
        codes = np.maximum.reduce([self._codes(output, place) for output in outputs])
        limit = round((0.5 if settings.decide == "argmax" else settings.threshold) * FULL)
        mask = (codes > limit).astype(np.uint8)
        return Road(mask, codes, not any(map(is_labels, outputs)))

    def facts(self) -> Mapping[str, Any]:
        """Return facts about the network for results, beside its settings."""
        from onnxruntime import __version__

        names = class_names(self.file.metadata)
        return {
            "onnxruntime": __version__,
            "file": self.file.path.name,
            "sha256": self.file.sha256,
            "licence": licence(self.file.metadata),
            "inputs": [str(each) for each in self.file.inputs],
            "outputs": [str(each) for each in self.file.outputs],
            "road": [names.get(each, str(each)) for each in self.settings.road_numbers],
        }

    def _codes(self, output: npt.NDArray[Any], place: Placement) -> Probability:
        scores = as_scores(output, self.settings.layout)
        assert scores is not None
        if is_labels(output):
            road = np.isin(scores[0], self.settings.road_numbers).astype(np.uint16)
            return place.back(FULL * road, exact=True)
        shares = road_probability(scores.astype(np.float32), self.settings)
        if not np.isfinite(shares).all():
            raise self.file.error("gives NaN")
        framed = np.clip(place.back(shares, exact=False), 0, 1)
        return np.rint(framed * np.float32(FULL)).astype(np.uint16)


def road_probability(scores: Values, settings: NetSettings) -> Values:
    """Compute how probable road is, ``(h, w)`` float32 in 0..1, from ``(C, h, w)`` float32 scores.

    For ``argmax`` it is road against the rest: the best class of road against the best other one,
    so that the mask is where it is above one half. For ``threshold`` it is the sum over the classes
    of road, and of a ``sigmoid`` the greatest of them.
    """
    chosen = np.zeros(len(scores), np.bool_)
    chosen[settings.road_numbers] = True
    best: Values = scores[chosen].max(axis=0)
    if settings.decide == "argmax":
        other = scores[~chosen].max(axis=0)
        if settings.activation != "none":
            return _sigmoid(best - other)
        with np.errstate(invalid="ignore"):
            share: Values = best / (best + other)
        return np.where(best + other > 0, share, 0.0).astype(np.float32)
    if settings.activation == "sigmoid":
        return _sigmoid(best)
    if settings.activation == "softmax":
        powers = np.exp(scores - scores.max(axis=0))
        share = powers[chosen].sum(axis=0) / powers.sum(axis=0)
    else:
        share = np.clip(scores[chosen].sum(axis=0), 0, 1)
    return share


def _sigmoid(values: Values) -> Values:
    """Compute ``1 / (1 + exp(-x))``, in a form that cannot overflow."""
    result: Values = 0.5 + 0.5 * np.tanh(0.5 * values)
    return result


GREY: Final = 114
"""Grey level around an image that does not fill a letterbox."""

Plane = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Placement:
    """Where frames of one size lie in a network's input; sizes are width and height."""

    frame: tuple[int, int]
    """Size of the frame."""
    size: tuple[int, int]
    """Size of the input."""
    inner: tuple[int, int]
    """Size that the frame is brought to."""

    def image(self, image: Rgb) -> Rgb:
        """Return the input's pixels, ``(h, w, 3)`` uint8, of an ``(H, W, 3)`` uint8 frame."""
        small: Rgb = cv2.resize(image, self.inner, interpolation=cv2.INTER_LINEAR)
        if self.inner == self.size:
            return small
        whole = np.full((*self.size[::-1], 3), GREY, np.uint8)
        there, here = self._overlap()
        whole[there] = small[here]
        return whole

    def back(self, plane: Plane, *, exact: bool) -> Plane:
        """Bring an ``(h, w)`` map of the input, or a smaller one of all of it, to the frame's size.

        Interpolated linearly, or if ``exact`` by the nearest pixel, as for labels. Pixels of the
        frame that the input does not show are 0.
        """
        how = cv2.INTER_NEAREST_EXACT if exact else cv2.INTER_LINEAR
        if self.inner != self.size:
            whole = cv2.resize(plane, self.size, interpolation=how)
            plane = np.zeros(self.inner[::-1], plane.dtype)
            there, here = self._overlap()
            plane[here] = whole[there]
        framed: Plane = cv2.resize(plane, self.frame, interpolation=how)
        return framed

    def _overlap(self) -> tuple[Any, Any]:
        """Return where the input and the resized frame overlap, as slices of each."""
        there, here = [], []
        for whole, inner in zip(self.size[::-1], self.inner[::-1], strict=True):
            begin = (whole - inner) // 2  # negative where the frame is cut off
            first, last = max(0, begin), min(whole, begin + inner)
            there.append(slice(first, last))
            here.append(slice(first - begin, last - begin))
        return tuple(there), tuple(here)


@lru_cache(maxsize=16)
def placement(frame: tuple[int, int], size: tuple[int, int], resize: str) -> Placement:
    """Place frames of a width and height in an input of a size, see `NetSettings.resize`."""
    if resize == "stretch":
        return Placement(frame, size, size)
    ratios = [whole / side for whole, side in zip(size, frame, strict=True)]
    ratio = min(ratios) if resize == "letterbox" else max(ratios)
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
