"""A network's road mask of a frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt

from roadeval.data import Mask, Probability, Rgb
from roadeval.data.arrays import Values
from roadeval.networks.onnx_file import OnnxFile, load
from roadeval.networks.placement import Placement, input_values, placement
from roadeval.networks.settings import NetSettings
from roadeval.networks.stating import as_scores, class_names, is_labels, licence, stated

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
    """A network with settings that leave nothing open; any thread may call its methods."""

    settings: NetSettings
    file: OnnxFile

    @classmethod
    def of(cls, settings: NetSettings) -> Self:
        """Open the network of some settings.

        Raises
        ------
        NetworkError
            If it cannot be used, or settings are missing that its file does not tell.
        """
        file = load(settings)
        return cls(stated(settings, file), file)

    def road(self, image: Rgb) -> Road:
        """Find the road in an ``(H, W, 3)`` uint8 RGB image.

        The probability of road is computed on the network's own grid and interpolated linearly to
        the frame's size; classes are brought there by the nearest pixel. With several outputs it is
        the greatest of theirs.

        Raises
        ------
        NetworkError
            If the network fails on it, or gives NaN.
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
        """Return what results tell of the network beside its settings."""
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
            raise self.file.error("gives numbers that are none (NaN)")
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
