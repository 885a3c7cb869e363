"""The interface of a stage.

A stage is one file in `roadeval.pipeline.paper` or `roadeval.pipeline.beyond` that defines
``STAGE``, a `Stage`. A configuration names it in its ``chain``. A minimal one is a filter without
parameters to learn::

    DARKER = LayerSpec("darker", LayerKind.RGB, "Half as bright")

    @stage_settings
    class DarkerSettings:
        share: float = 0.5

    @per_view
    def bind(settings: DarkerSettings, _learnt: None, view: View) -> Output:
        image = (view.image * settings.share).astype(np.uint8)
        return Output((Layer(DARKER, image),), image=image)

    STAGE = Stage("darker", "Half as bright", DarkerSettings, bind, (DARKER,), is_filter=True)

Recording, tables and report iterate over stages and layers, and know none by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial, wraps
from typing import Any, Final, TypeVar, cast, dataclass_transform

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict
from pydantic.dataclasses import dataclass as validated

from roadeval.data import ROAD, Frame, LayerSpec, Moment, Output, Packed, Rgb, Truth
from roadeval.data.arrays import Flags, Places, Planes
from roadeval.errors import RoadevalError

T = TypeVar("T")


@dataclass_transform(frozen_default=True)
def stage_settings(cls: type[T]) -> type[T]:
    """Make a class the settings of a stage: frozen, validated, every field with a default."""
    return cast("type[T]", validated(cls, frozen=True, config=ConfigDict(extra="forbid")))


@stage_settings
class NoSettings:
    """The stage has no settings."""


class MisfitError(RoadevalError, ValueError):
    """Parameters that do not fit a stage's settings: which, and what to do."""


class StageError(RoadevalError):
    """A stage that fails on a frame, which is then skipped: which stage, and why."""


class AbsentError(StageError):
    """A frame without another method's mask: only the variant that needs the mask skips it."""


@dataclass(frozen=True, eq=False)
class View:
    """The input of a stage; views of one image share its arrays."""

    original: Rgb
    """``(H, W, 3)`` uint8 RGB: the image as logged."""
    image: Rgb
    """The image after the filters that ran before this stage, C-contiguous."""
    planes: Planes = field(repr=False)
    """Red, green and blue of ``image``, ``(H, W)`` uint8 each."""
    opinion: Output | None = None
    """The output of the previous stage that made a road mask, if there was one."""
    moment: Moment | None = None
    """When the image was taken; None if it belongs to no drive."""
    external: Mapping[str, Output] = field(default_factory=dict)
    """Masks of other methods on the frame, by the names of their variants."""

    @classmethod
    def of(
        cls, image: Rgb, moment: Moment | None = None, external: Mapping[str, Output] | None = None
    ) -> View:
        """Return the view of the first stage of an ``(H, W, 3)`` uint8 RGB image."""
        image = np.ascontiguousarray(image)
        return cls(image, image, split(image), moment=moment, external=external or {})

    @classmethod
    def of_frame(cls, frame: Frame) -> View:
        """Return the view of the first stage of a frame."""
        external = {
            name: Output(mask=Packed.of(mask), probability=frame.probabilities.get(name))
            for name, mask in frame.external.items()
        }
        return cls.of(frame.image, frame.moment, external)

    @property
    def mask(self) -> Packed | None:
        """The road mask of the opinion."""
        return None if self.opinion is None else self.opinion.mask

    def after(self, output: Output) -> View:
        """Return the view of the next stage."""
        image = self.image if output.image is None else output.image
        planes = self.planes if image is self.image else split(image)
        opinion = self.opinion if output.mask is None else output
        return replace(self, image=image, planes=planes, opinion=opinion)


@dataclass(frozen=True)
class Stage:
    """One step of a pipeline."""

    name: str
    """Its name in a chain, a configuration, tables and recordings, and that of its mask's layer."""
    title: str
    """A few words for a person, as ``Phase 1: colour similarity``."""
    settings: type[Any]
    """The type of its settings, a frozen dataclass; every field has a default."""
    bind: Callable[[Any, Any], Callable[[View], Output]]
    """``bind(settings, parameters)`` returns the pure function from `View` to `Output`. It also
    computes, once, all that depends on settings and parameters alone (tables, structuring
    elements). A `MisfitError` if the parameters do not fit the settings."""
    layers: tuple[LayerSpec, ...] | Callable[[Any], tuple[LayerSpec, ...]]
    """The layers of its output, in order; or a function that returns them for its settings."""
    fit: Callable[[TrainingSet, Any], Any] | None = None
    """``fit(training_set, settings)`` learns the parameters; None if there is nothing to learn."""
    adapt: Callable[[Any, TrainingSet, Any], Any] | None = None
    """``adapt(parameters, training_set, settings)`` learns further from a drive's own frames, on
    top of parameters from other drives; None if those stay unchanged."""
    parameters: type[Any] | None = None
    """The type of the parameters, for reading model files: a frozen dataclass of floats and arrays;
    None if there are none."""
    is_filter: bool = False
    """Whether it only changes the image, and is left out of the ``unfiltered`` variant, which shows
    its effect."""
    preprocesses: bool = False
    """Whether it only changes the image, in every variant."""
    oracle: Callable[[Any, Any, View, Truth], Output] | None = None
    """``oracle(settings, parameters, view, truth)`` returns the output of a perfect stage, made
    from the truth of shadow for a filter, else from that of the road. None if there is none."""
    inference_only: tuple[str, ...] = ()
    """Settings that the learnt parameters do not depend on: a model may be used with other values
    than those it was trained with."""
    hears: Callable[[Any], bool] | None = None
    """``hears(settings)`` tells whether it learns from the output of the stage before. That stage
    must not be trained: its output on its training frames would be over-confident. None: never."""
    resolve: Callable[[Any], Any] | None = None
    """``resolve(settings)`` returns the settings with all values that their file holds, and its
    digest; a `RoadevalError` if the file cannot be used. None if they name no file."""
    places: tuple[str, ...] = ()
    """Settings that are paths of files, and change nothing once the file's digest is stated."""
    about: Callable[[Any], Mapping[str, Any]] | None = None
    """``about(settings)`` returns facts for results beside its settings, as plain data by name."""
    code: str | None = None
    """SHA-256 of the file that defines a stage from outside the package, empty without a file; None
    for roadeval's own stages, which its version identifies."""

    def specs(self, settings: Any) -> tuple[LayerSpec, ...]:
        """Return the layers of its output with these settings, in order."""
        return self.layers(settings) if callable(self.layers) else self.layers

    @property
    def yields_mask(self) -> bool:
        """Whether its output is a road mask; otherwise it is an image for the stages after it."""
        return not (self.is_filter or self.preprocesses)


def per_view(
    run: Callable[[Any, Any, View], Output],
) -> Callable[[Any, Any], Callable[[View], Output]]:
    """Return the `Stage.bind` of a stage that prepares nothing: ``run(settings, learnt, view)``."""

    @wraps(run)
    def bind(settings: Any, learnt: Any) -> Callable[[View], Output]:
        return partial(run, settings, learnt)

    return bind


def perfect_mask(_settings: Any, _parameters: Any, _view: View, truth: Truth) -> Output:
    """Return the truth as the road mask of a perfect stage, ignored pixels non-road."""
    return Output(mask=Packed.of(truth == ROAD))


def split(image: Rgb) -> Planes:
    """Return red, green and blue of an ``(H, W, 3)`` uint8 image, ``(H, W)`` uint8 each."""
    red, green, blue = channels = [np.empty(image.shape[:2], np.uint8) for _ in range(3)]
    # OpenCV takes three times as long if it allocates the arrays itself.
    cv2.split(image, channels)
    return red, green, blue


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """Labelled pixels of some frames, after one variant's filters."""

    images: tuple[Rgb, ...]
    """The training frames, each ``(H, W, 3)`` uint8 RGB."""
    frame: Places
    row: Places
    column: Places
    """``(n,)`` integers each: the place of each sampled pixel."""
    road: Flags
    """``(n,)`` bool: its label."""
    seed: int = 0
    """Seed of everything that a fit draws at random."""
    share: float | None = None
    """Share of road among the labelled pixels of the frames; the sample has as many pixels of road
    as of the rest. None if the labels are a guess, whose share cannot be trusted."""
    truths: tuple[Truth, ...] = ()
    """The truth of every pixel of the frames, for fits that need more than the sample."""
    opinions: tuple[Output | None, ...] = ()
    """The output of the stage before for each frame, if it makes a mask; empty if none is heard."""

    def colours(self) -> npt.NDArray[np.uint8]:
        """Return the colours of the sampled pixels, ``(n, 3)`` uint8 RGB."""
        colours = np.empty((len(self.road), 3), np.uint8)
        for index, image in enumerate(self.images):
            here = self.frame == index
            colours[here] = image[self.row[here], self.column[here]]
        return colours


GREATEST: Final = 1e15
"""Greatest learnt number: sums of products of two such numbers and a colour stay finite, in float32
too."""


def check_arrays(
    parameters: Any, dtype: type[np.number[Any]], **shapes: tuple[int | str, ...]
) -> None:
    """Check the shapes, types and numbers of a stage's parameters.

    A `ValueError` that names the field if one has another shape or type, or holds a number that is
    not finite or beyond `GREATEST`. ``parameters`` is a dataclass, ``dtype`` the type of its
    arrays; single numbers may be of any real type. ``shapes`` has the shape of each field: a letter
    stands for a length of one or more, the same wherever it occurs; ``()`` is a single number.
    """
    lengths: dict[int | str, int] = {}
    for name, shape in shapes.items():
        array = np.asarray(getattr(parameters, name))
        lengths = dict(zip(shape, array.shape, strict=False)) | lengths  # the first one holds
        expected = [side if isinstance(side, int) else lengths.get(side) for side in shape]
        if [*array.shape] != expected or not array.size:
            there = str(shape).replace("'", "")
            raise ValueError(f"{name} has the shape {array.shape} instead of {there}")
        if array.dtype != dtype if shape else array.dtype.kind not in "iuf":
            raise ValueError(f"{name} is of type {array.dtype} instead of {np.dtype(dtype)}")
        check_range(name, array, -GREATEST, GREATEST)


def check_range(name: str, values: npt.ArrayLike, least: float, greatest: float) -> None:
    """Raise a ValueError if a number is NaN or lies outside a range, which includes both ends."""
    array = np.asarray(values, np.float64)  # a smaller type could not hold the ends
    if not ((array >= least) & (array <= greatest)).all():
        raise ValueError(f"{name} holds a number outside {least:g} to {greatest:g}")
