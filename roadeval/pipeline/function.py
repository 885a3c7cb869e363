"""A plain function as a stage."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from roadeval.data import Layer, LayerSpec, mask_spec
from roadeval.data.packed import Packed
from roadeval.pipeline.stage import Output, Stage, View

TAKEN: Final = ("image", "moment", "settings")
"""The names of the arguments that a function may have."""
FULL: Final = 65535
"""The code of a probability of 1."""


@dataclass(frozen=True)
class NoSettings:
    """Settings of a function that has none."""


def stage_of_function(name: str, function: Callable[..., Any]) -> Stage[Any, None]:
    """Return the stage of a function from an image to a road mask.

    Parameters
    ----------
    name
        Of the stage.
    function
        Its arguments are given by their names: ``image``, ``(H, W, 3)`` uint8 RGB; ``moment``, a
        `roadeval.data.Moment`, or None for an image by itself; and ``settings``, whose default is
        an instance of a dataclass. It returns ``(H, W)`` bool or whole numbers, nonzero where road
        is; or floats from 0 to 1, how probable road is, whose mask is what is above one half; or
        an `Output` without layers other than its mask.

    Raises
    ------
    TypeError
        If it has other arguments.
    """
    arguments = inspect.signature(function).parameters
    for argument, about in arguments.items():
        if argument not in TAKEN and about.default is about.empty:
            raise TypeError(f"its argument {argument} is none of {', '.join(TAKEN)}")
    if "image" not in arguments:
        raise TypeError("it has no argument image")
    settings: type[Any] = NoSettings
    if "settings" in arguments:
        default = arguments["settings"].default
        if isinstance(default, type) or not dataclasses.is_dataclass(default):
            raise TypeError("the default of its argument settings is no instance of a dataclass")
        settings = type(default)
    spec = mask_spec(name, _title(name, function))

    def bind(values: Any, _parameters: None) -> Callable[[View], Output]:
        given = {"settings": values} if "settings" in arguments else {}

        def run(view: View) -> Output:
            seen = {"moment": view.moment} if "moment" in arguments else {}
            return _output(function(image=view.image, **seen, **given), spec)

        return run

    return Stage(name, spec.title, settings, bind, lambda _settings: (spec,))


def _title(name: str, function: Callable[..., Any]) -> str:
    """Return the first line of a function's docstring, without its full stop."""
    return (inspect.getdoc(function) or name).partition("\n")[0].rstrip(".") or name


def _output(found: Any, spec: LayerSpec) -> Output:
    if isinstance(found, Output):
        if found.layers or found.mask is None:
            return found
        return dataclasses.replace(found, layers=(Layer(spec, found.mask),))
    array = np.asarray(found)
    if array.ndim != 2:
        raise ValueError(f"it returned {array.dtype} of shape {array.shape}, and no (H, W) mask")
    if array.dtype.kind != "f":
        mask = Packed.of(array != 0)
        return Output((Layer(spec, mask),), mask=mask)
    if not ((array >= 0) & (array <= 1)).all():
        raise ValueError("it returned floats that are no probabilities, from 0 to 1")
    codes = np.rint(array * FULL).astype(np.uint16)
    mask = Packed.of(codes > round(FULL / 2))
    return Output((Layer(spec, mask),), mask=mask, probability=codes)
