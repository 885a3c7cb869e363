"""A camera frame: image, times, truth, and use."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.data.calibration import Calibration

Rgb = npt.NDArray[np.uint8]
"""``(H, W, 3)`` uint8, channels red, green, blue."""
Mask = npt.NDArray[np.uint8]
"""``(H, W)`` uint8: 1 inside, 0 outside."""
Truth = npt.NDArray[np.uint8]
"""``(H, W)`` uint8: 0 non-road, 1 road, 255 ignore."""
Probability = npt.NDArray[np.uint16]
"""``(H, W)`` uint16: codes 0..65535 that span 0..1."""
Classes = npt.NDArray[np.uint8]
"""``(H, W)`` uint8: codes of the truth's classes; `NO_CLASS` for none."""
Histogram = npt.NDArray[np.uint32]
"""``(2, 65536)`` uint32: non-road and road pixels by the code of their probability."""

NON_ROAD: Final = 0
ROAD: Final = 1
IGNORE: Final = 255
NO_CLASS: Final = 255


class TruthClass(NamedTuple):
    """A class of the truth's labels."""

    value: int
    """The label's value, or its colour as red * 65536 + green * 256 + blue."""
    name: str
    """Its name; empty if it is not known."""
    truth: str
    """``road``, ``other`` or ``ignored``."""


@dataclass(frozen=True)
class Moment:
    """The ``number`` and ``stamp_ns`` of a `Frame`."""

    number: int
    stamp_ns: int


@dataclass(frozen=True, eq=False)
class Frame:
    """One camera image with its times and, if the log has one, its truth."""

    number: int
    """Position in the image topic by log time, from 0, before any range or stride."""
    stamp_ns: int
    """Header stamp."""
    log_time_ns: int
    image: Rgb
    payload: bytes | memoryview
    """The image in the log; for a compressed image the JPEG or PNG file itself."""
    media_type: str | None = None
    """``image/jpeg`` or ``image/png`` if ``payload`` is such a file."""
    truth: Truth | None = None
    """Road truth, or None for an unlabelled frame."""
    shadow_truth: Truth | None = None
    """Mask of truly shadowed pixels, with values as in ``truth``."""
    external: Mapping[str, Mask] = field(default_factory=dict)
    """Road masks of other systems, by variant name."""
    probabilities: Mapping[str, Probability] = field(default_factory=dict)
    """Probabilities of road, from which thresholds make masks of other systems."""
    camera: str = ""
    """The image topic."""
    classes: Classes | None = None
    """The classes of the truth's pixels, by their codes; None if the truth has no classes."""
    name: str = ""
    """The name of its image, such as ``umm_000012``, if the log has it."""
    calibration: Calibration | None = None
    """Its own calibration and mounting, if each image of the log has one."""

    @property
    def moment(self) -> Moment:
        """Its number and stamp."""
        return Moment(self.number, self.stamp_ns)

    def digest(self) -> str:
        """Return a hash of the payload, which is the same for equal images in two logs."""
        return hashlib.blake2b(self.payload, digest_size=16).hexdigest()


class Role(StrEnum):
    """The use of a frame in a run. Only `EVALUATED` frames are ever counted.

    A `COPY` repeats the image of a training frame. A `PICKED` frame was labelled because it was in
    doubt, so it does not represent the others.
    """

    EVALUATED = "evaluated"
    TRAINING = "training"
    COPY = "copy"
    GAP = "gap"
    UNLABELLED = "unlabelled"
    PICKED = "picked"
