"""What a stage is: a name, its settings, a way to fit it, and a pure function on a frame.

A chain of stages is a pipeline. Recording, tables and report iterate over stages and layers and
know none by name, so a new stage is one new file that defines a `Stage`, and its name in a
configuration's ``chain``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from roadeval.data import ROAD, Layer, LayerSpec, Rgb, Truth
from roadeval.data.packed import Packed
from roadeval.errors import RoadevalError
from roadeval.pipeline.paper.hsi import Planes, planes

S = TypeVar("S")
"""Settings of a stage: a frozen, validated dataclass."""
P = TypeVar("P")
"""Parameters that a stage learns: a frozen dataclass of floats and arrays, or None."""


class MisfitError(RoadevalError, ValueError):
    """Parameters that do not fit a stage's settings: which, and what to do."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What a stage sees of a frame.

    ``original`` is the image as logged, ``image`` the same after the filters that ran before
    this stage, both ``(H, W, 3)`` uint8 RGB; ``mask`` is the previous stage's road mask.
    Views of one image share what `planes` has found of it, in a list that begins empty.
    """

    original: Rgb
    image: Rgb
    mask: Packed | None = None
    _apart: list[Planes] = field(default_factory=list, repr=False)

    @classmethod
    def of(cls, image: Rgb) -> View:
        """See an ``(H, W, 3)`` uint8 RGB image as it is before any stage."""
        return cls(image, image)

    def planes(self) -> Planes:
        """Red, green and blue of the image, ``(H, W)`` uint8 each; taken apart once for all."""
        if not self._apart:
            self._apart.append(planes(self.image))
        return self._apart[0]

    def after(self, output: Output) -> View:
        """Give what the next stage sees."""
        # By hand: `dataclasses.replace` takes several times as long, and runs thirty times a frame.
        mask = self.mask if output.mask is None else output.mask
        if output.image is None or output.image is self.image:
            return View(self.original, self.image, mask, self._apart)
        return View(self.original, output.image, mask)


@dataclass(frozen=True, slots=True, eq=False)
class Output:
    """What a stage hands out.

    ``image`` replaces the image for the stages after it; ``mask`` is its road mask (whose pixels
    are also among its ``layers``, under the stage's name); ``regions`` are pixel sets to count
    apart; ``facts`` are numbers about the frame.
    """

    layers: tuple[Layer, ...] = ()
    image: Rgb | None = None
    mask: Packed | None = None
    regions: Mapping[str, Packed] = field(default_factory=dict)
    facts: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class TrainingSet:
    """Labelled pixels of some frames, as one variant's filters left them.

    Parameters
    ----------
    images
        The training frames, each ``(H, W, 3)`` uint8 RGB.
    frame, row, column
        ``(n,)`` integers: where each sampled pixel lies.
    road
        ``(n,)`` bool: its label.
    seed
        For whatever a fit draws at random.
    """

    images: tuple[Rgb, ...]
    frame: npt.NDArray[np.intp]
    row: npt.NDArray[np.intp]
    column: npt.NDArray[np.intp]
    road: npt.NDArray[np.bool_]
    seed: int = 0

    def colours(self) -> npt.NDArray[np.uint8]:
        """``(n, 3)`` uint8 RGB of the sampled pixels."""
        colours = np.empty((len(self.road), 3), np.uint8)
        for index, image in enumerate(self.images):
            here = self.frame == index
            colours[here] = image[self.row[here], self.column[here]]
        return colours


@dataclass(frozen=True, slots=True)
class Stage(Generic[S, P]):
    """One step of a pipeline.

    Parameters
    ----------
    name
        In a chain and in a configuration.
    title
        A few words for a person, as ``Phase 1: colour similarity``.
    settings
        The type of its settings; every field has a default.
    bind
        ``bind(settings, parameters)`` returns the pure function from `View` to `Output`. What
        depends on settings and parameters alone (tables, structuring elements) is made here,
        once. A `MisfitError` if the parameters do not fit the settings.
    layers
        ``layers(settings)``: the layers it will hand out, in order.
    fit
        ``fit(training_set, settings)`` learns the parameters; None if there is nothing to learn.
    parameters
        The type of the parameters, for reading model files; None if there are none.
    is_filter
        Whether it only prepares the image, and is left out of the ``unfiltered`` variant, which
        shows what it does.
    prepares
        Whether it only prepares the image, in every variant.
    oracle
        ``oracle(settings, parameters)`` returns the stage as it would be if it were perfect: a
        pure function of `View` and the truth, of shadow for a filter, else of the road. None
        where nobody asks what a perfect one would bring.
    deciding
        Settings that only decide: what is learnt does not depend on them, and a model may be used
        with others than it was trained with.
    mask
        Its mask's layer, and its name in tables and timing, where that is not ``name``: stages
        that do the same in different ways are tabled under one name.
    sees_mask_alone
        Whether it looks at nothing but the mask before it. After a perfect mask it then makes the
        same in every variant that has its settings.
    """

    name: str
    title: str
    settings: type[S]
    bind: Callable[[S, Any], Callable[[View], Output]]
    layers: Callable[[S], tuple[LayerSpec, ...]]
    fit: Callable[[TrainingSet, S], P] | None = None
    parameters: type[P] | None = None
    is_filter: bool = False
    prepares: bool = False
    oracle: Callable[[S, Any], Callable[[View, Truth], Output]] | None = None
    deciding: tuple[str, ...] = ()
    mask: str = ""
    sees_mask_alone: bool = False

    @property
    def yields_mask(self) -> bool:
        """Whether it hands out a road mask; else an image for the stages after it."""
        return not (self.is_filter or self.prepares)

    @property
    def reported(self) -> str:
        """Its name in tables, recordings and timing."""
        return self.mask or self.name


def perfect_mask(_settings: Any, _parameters: Any) -> Callable[[View, Truth], Output]:
    """Return the oracle of a stage that yields a road mask: the truth, ignored pixels non-road."""

    def run(_view: View, truth: Truth) -> Output:
        return Output(mask=Packed.of(truth == ROAD))

    return run
