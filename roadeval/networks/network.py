"""A network's road mask of a frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from roadeval.data import Mask, Probability, Rgb
from roadeval.data.arrays import Values
from roadeval.networks import metadata
from roadeval.networks.loaded import Loaded, load
from roadeval.networks.placement import Placement, placement
from roadeval.networks.scores import as_scores, road_numbers, road_probability
from roadeval.networks.settings import NetSettings
from roadeval.networks.stating import is_labels, stated
from roadeval.networks.values import input_values

FULL = 65535
"""The code of a probability of 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Road:
    """The road mask of a frame by a network, and its probability.

    Parameters
    ----------
    mask
        ``(H, W)`` uint8, 1 road.
    codes
        How probable road is, ``(H, W)`` uint16 codes 0..65535 that span 0..1.
    graded
        Whether the mask is a threshold on them; otherwise the network gives classes alone, and
        they are 0 and 65535.
    """

    mask: Mask
    codes: Probability
    graded: bool


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A network with settings that leave nothing open; any thread may call its methods."""

    settings: NetSettings
    loaded: Loaded

    @classmethod
    def of(cls, settings: NetSettings) -> Self:
        """Open the network of some settings.

        Raises
        ------
        NetworkError
            If it cannot be used, or settings are missing that its file does not tell.
        """
        loaded = load(settings)
        return cls(stated(settings, loaded), loaded)

    def road(self, image: Rgb) -> Road:
        """Find the road in an ``(H, W, 3)`` uint8 RGB image.

        The probability of road is computed on the network's own grid and interpolated linearly to
        the frame's size; classes are brought there by the nearest pixel. With several outputs it is
        the greatest of theirs.

        Raises
        ------
        NetworkError
            If the network fails on it, or gives numbers that are none.
        """
        settings = self.settings
        assert settings.size is not None
        height, width = image.shape[:2]
        place = placement((width, height), settings.size, settings.resize)
        values = input_values(place.image(image), settings, self.loaded.file.inputs[0].dtype)
        outputs = self.loaded.backend.run(values, settings.outputs or ())
        codes = np.maximum.reduce([self._codes(output, place) for output in outputs])
        limit = round((0.5 if settings.decide == "argmax" else settings.threshold) * FULL)
        mask = (codes > limit).astype(np.uint8)
        return Road(mask, codes, not any(map(is_labels, outputs)))

    def facts(self) -> Mapping[str, Any]:
        """Return what results tell of the network beside its settings."""
        file = self.loaded.file
        names = metadata.class_names(file.metadata)
        road = [names.get(each, str(each)) for each in road_numbers(self.settings)]
        return {
            "backend": self.loaded.backend_name,
            "version": self.loaded.backend.version,
            "file": file.path.name,
            "sha256": file.sha256,
            "licence": metadata.licence(file.metadata),
            "inputs": [str(each) for each in file.inputs],
            "outputs": [str(each) for each in file.outputs],
            "road": road,
        }

    def _codes(self, output: npt.NDArray[Any], place: Placement) -> Probability:
        assert self.settings.layout is not None
        scores = as_scores(output, self.settings.layout)
        assert scores is not None
        if is_labels(output):
            road = np.isin(scores[0], road_numbers(self.settings)).astype(np.uint16)
            return place.back(FULL * road, exact=True)
        shares: Values = road_probability(scores.astype(np.float32), self.settings)
        if not np.isfinite(shares).all():
            raise self.loaded.file.error("gives numbers that are none (NaN)")
        framed = np.clip(place.back(shares, exact=False), 0, 1)
        return np.rint(framed * np.float32(FULL)).astype(np.uint16)
