"""Layers: the named arrays that stages return, with their kinds and colours."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import colours
from roadeval.data.arrays import FN, FP, IGNORED, TN, TP, Packed
from roadeval.data.colours import CLEAR
from roadeval.data.frame import IGNORE, NON_ROAD, ROAD


class LayerKind(StrEnum):
    """The kind of a layer's array.

    `MASK`: one class or a few, shown by colour alone. `LABELS`: classes with names in the viewer.
    `SCALAR`: a map of numbers. `RGB`: a colour image.
    """

    RGB = "rgb"
    MASK = "mask"
    LABELS = "labels"
    SCALAR = "scalar"


@dataclass(frozen=True)
class LabelClass:
    """One value of a label image: its name and its sRGB colour with opacity (0..255 each)."""

    value: int
    name: str
    rgba: tuple[int, int, int, int]


@dataclass(frozen=True)
class LayerSpec:
    """The description of a layer, known before the first frame."""

    name: str
    """Last part of the entity path, such as ``ndi`` in ``/filtered/ndi``."""
    kind: LayerKind
    title: str
    """A few words for people, such as ``NDI (Eq. 6)``."""
    classes: tuple[LabelClass, ...] = ()
    """For `LABELS` and `MASK`: the values that occur."""
    value_range: tuple[float, float] = (0.0, 1.0)
    """For `SCALAR`: least and greatest value to show; values outside are clipped for display."""
    exact: bool = True
    """Whether the recording must give back the same array (masks, labels, colours). A scalar map
    comes back as the nearest of 256 levels over ``value_range``. If the image has more than 800
    columns, it comes back as means of blocks of pixels, in at most 400 columns, to 1/127 of half
    the range. A layer that is not exact is recorded with some loss, and at half the resolution or
    less.
    """
    photographic: bool = False
    """For `SCALAR`: whether it varies as a photograph does, without plateaus of one value. The
    recording has it as a JPEG, to be looked at: within 3 of 256 levels on average."""


@dataclass(frozen=True, eq=False)
class Layer:
    """A named array that a stage returns; a mask of two classes may stay packed."""

    spec: LayerSpec
    content: npt.NDArray[np.uint8] | npt.NDArray[np.float32] | Packed

    @property
    def array(self) -> npt.NDArray[np.uint8] | npt.NDArray[np.float32]:
        """The array itself.

        ``(H, W, 3)`` uint8 for `RGB`, ``(H, W)`` uint8 for `MASK` and `LABELS`, and ``(H, W)``
        float32, or uint8 codes 0..255 that span ``spec.value_range``, for `SCALAR`.
        """
        return self.content.pixels() if isinstance(self.content, Packed) else self.content


ROAD_CLASSES: Final = (
    LabelClass(NON_ROAD, "non-road", CLEAR),
    LabelClass(ROAD, "road", (*colours.ROAD, 160)),
)
IGNORED_CLASS: Final = LabelClass(IGNORE, "ignored", (*colours.IGNORE, 160))
TRUTH: Final = LayerSpec("truth", LayerKind.MASK, "Ground truth", (*ROAD_CLASSES, IGNORED_CLASS))
ERRORS: Final = LayerSpec(
    "errors",
    LayerKind.MASK,
    "Errors of the final mask",
    (
        LabelClass(TN, "TN", CLEAR),
        LabelClass(TP, "TP", (*colours.TP, 160)),
        LabelClass(FP, "FP", (*colours.FP, 220)),
        LabelClass(FN, "FN", (*colours.FN, 220)),
        LabelClass(IGNORED, "ignored", (*colours.IGNORE, 160)),
    ),
)


def mask_spec(name: str, title: str, **colours: tuple[int, int, int, int]) -> LayerSpec:
    """Describe a mask of non-road and road, or of named classes with values from 0 and colours."""
    named = enumerate(colours.items())
    classes = tuple(LabelClass(value, label, colour) for value, (label, colour) in named)
    return LayerSpec(name, LayerKind.MASK, title, classes or ROAD_CLASSES)
