"""Every stage that a chain may name: roadeval's own, installed ones, and those of a module.

Code of somebody else runs only where its name stands in a ``chain``: as an entry point of the group
``roadeval.stages``, or as ``module:name``, which Python must be able to import.
"""

from __future__ import annotations

import inspect
import re
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, is_dataclass, replace
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.data import CERTAIN, Layer, LayerKind, LayerSpec, Packed, is_plain, mask_spec
from roadeval.errors import RoadevalError
from roadeval.pipeline import beyond, paper
from roadeval.pipeline.stage import Output, Stage, StageError, View, per_view
from roadeval.runtime.discovery import by_name, found_in
from roadeval.runtime.files import sha256_of
from roadeval.runtime.text import visible

GROUP: Final = "roadeval.stages"
"""The group of entry points by which a package adds stages."""

STAGES: Final[Mapping[str, Stage]] = by_name(
    (*found_in(beyond, "STAGE"), *found_in(paper, "STAGE"))
)
"""The stages of this package, found by their folder."""


PACKAGE: Final = Path(__file__).parents[1]
"""The folder of roadeval itself."""
TAKEN: Final = ("image", "moment", "settings")
"""The names of the arguments that a function may have."""


class UnknownStageError(RoadevalError, LookupError):
    """A name in a chain that is no stage: which, and why."""


def names() -> list[str]:
    """List the names that a chain may hold, besides ``module:name``."""
    return [*STAGES, *sorted(_added() - STAGES.keys())]


@cache
def _added() -> frozenset[str]:
    """Return the names of the stages that packages add: to look through all packages takes long."""
    return frozenset(each.name for each in entry_points(group=GROUP))


def stages_of(chain: Iterable[str]) -> tuple[Stage, ...]:
    """Return the stages that a chain names, in order; an `UnknownStageError` if one is none."""
    return tuple(STAGES.get(name) or _somebodys(name) for name in chain)


@cache
def _somebodys(name: str) -> Stage:
    """Import a stage that is not this package's own; its results say which file defines it."""
    try:
        found = _imported(name)
        module = inspect.getmodule(found.bind if isinstance(found, Stage) else found)
        if callable(found) and not isinstance(found, type):
            found = stage_of_function(re.split("[:.]", name)[-1], found)
        if not isinstance(found, Stage):
            raise TypeError(f"it is {type(found).__name__}, and neither a Stage nor a function")
        _check(found)
        found = guarded(found)
        if (file := getattr(module, "__file__", None)) is None:
            return replace(found, code="")
        origin = {"stage": name, "file": Path(file).name, "sha256": sha256_of(Path(file))}
        own = found.about

        def about(settings: Any) -> Mapping[str, Any]:
            return {**origin, **(own(settings) if own else {})}

        return replace(found, about=about, code=origin["sha256"])
    except UnknownStageError:
        raise
    except Exception as error:  # whatever somebody's module raises
        raise UnknownStageError(f"stage {name!r} cannot be used: {_said(error)}") from error


def _said(error: Exception) -> str:
    return visible(" ".join(f"{type(error).__name__}: {error}".split()))


def _imported(name: str) -> Any:
    module, _, attributes = name.partition(":")
    if not attributes:
        points = [*entry_points(group=GROUP, name=name)]
        if not points:
            raise UnknownStageError(f"there is no stage {name!r}; choose {', '.join(names())}")
        return points[0].load()
    try:
        return attrgetter(attributes)(import_module(module))
    except ModuleNotFoundError as error:
        raise UnknownStageError(
            f"stage {name!r}: there is no module {error.name}: install it, or name its folder in "
            "PYTHONPATH"
        ) from error


def _check(stage: Stage) -> None:
    """Raise a ValueError where a stage's names cannot stand in results."""
    for each in (stage.name, *(spec.name for spec in stage.specs(stage.settings()))):
        if not is_plain(each):
            raise ValueError(f"its name {each!r} must be of letters, digits, '-' and '_' alone")
    if stage.name in STAGES:
        raise ValueError(f"its name {stage.name!r} is that of a stage of roadeval")
    if stage.fit is not None and stage.parameters is None:
        raise ValueError("it learns, and does not name the type of its parameters")


@dataclass(frozen=True)
class NoSettings:
    """Settings of a function that has none."""


def stage_of_function(name: str, function: Callable[..., Any]) -> Stage:
    """Return the stage of a function from an image to a road mask.

    A `TypeError` if it has other arguments. The function's arguments are given by their names:
    ``image``, ``(H, W, 3)`` uint8 RGB; ``moment``, a `roadeval.data.Moment`, or None for an image
    by itself; and ``settings``, whose default is an instance of a dataclass. It returns ``(H, W)``
    bool or whole numbers, nonzero where road is; or floats from 0 to 1, how probable road is, whose
    mask is what is above one half.
    """
    arguments = inspect.signature(function).parameters
    for argument, about in arguments.items():
        if argument not in TAKEN and about.default is about.empty:
            raise TypeError(f"its argument {argument} is none of {', '.join(TAKEN)}")
    if "image" not in arguments:
        raise TypeError("it has no argument image")
    default = arguments["settings"].default if "settings" in arguments else NoSettings()
    if isinstance(default, type) or not is_dataclass(default):
        raise TypeError("the default of its argument settings is no instance of a dataclass")
    first_line = (inspect.getdoc(function) or "").partition("\n")[0].rstrip(".")
    spec = mask_spec(name, first_line or name)

    @per_view
    def bind(settings: Any, _learnt: None, view: View) -> Output:
        given = {"image": view.image, "moment": view.moment, "settings": settings}
        return _output(function(**{key: given[key] for key in given if key in arguments}), spec)

    return Stage(name, spec.title, type(default), bind, (spec,))


def _output(found: Any, spec: LayerSpec) -> Output:
    array, codes = np.asarray(found), None
    if array.ndim != 2:
        raise ValueError(f"it returned {array.dtype} of shape {array.shape}, and no (H, W) mask")
    if array.dtype.kind == "f":
        if not ((array >= 0) & (array <= 1)).all():
            raise ValueError("it returned floats that are no probabilities, from 0 to 1")
        codes = np.rint(array * CERTAIN).astype(np.uint16)
        array = codes > round(CERTAIN / 2)
    mask = Packed.of(array != 0)
    return Output((Layer(spec, mask),), mask=mask, probability=codes)


def guarded(stage: Stage) -> Stage:
    """Return a stage whose every error is a `StageError`, and so is an output that cannot be."""

    def named(what: str, work: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any) -> Any:
            try:
                return work(*arguments)
            except (RoadevalError, MemoryError):
                raise
            except Exception as error:  # whatever somebody's code raises
                where = _place(error)
                raise StageError(f"stage {stage.name} {what}: {_said(error)}{where}") from error

        return run

    def bind(settings: Any, parameters: Any) -> Callable[[View], Output]:
        run, specs = stage.bind(settings, parameters), stage.specs(settings)

        def checked(view: View) -> Output:
            output = run(view)
            _check_output(output, view, stage, specs)
            return output

        return named("failed", checked)

    fit = stage.fit and named("cannot learn", stage.fit)
    return replace(stage, bind=named("cannot be made ready", bind), fit=fit)


def _place(error: Exception) -> str:
    """Return where in somebody's file an error arose, as `` (mine.py:12)``; else nothing."""
    frames = traceback.extract_tb(error.__traceback__)
    others = [each for each in frames if PACKAGE not in Path(each.filename).parents]
    own = [each for each in others if each.filename == others[0].filename][-1:]
    return "".join(f" ({Path(each.filename).name}:{each.lineno})" for each in own)


Held = tuple[int, tuple[type[np.generic], ...]]
"""Dimensions of an array, and the types of which one must be its own."""
KINDS: Final[Mapping[LayerKind, Held]] = {
    LayerKind.MASK: (2, (np.bool_, np.integer)),
    LayerKind.LABELS: (2, (np.uint8,)),
    LayerKind.RGB: (3, (np.uint8,)),
    LayerKind.SCALAR: (2, (np.number, np.bool_)),
}
"""Dimensions and types of the arrays that a recording can hold, by the kind of layer."""


def _check_output(output: Output, view: View, stage: Stage, specs: tuple[LayerSpec, ...]) -> None:
    """Raise an error where an output is none, or an array of another size or type than it must."""
    if not isinstance(output, Output):
        raise TypeError(f"it returned {type(output).__name__} and no Output")
    size = view.image.shape[:2]
    if stage.yields_mask and not isinstance(output.mask, Packed):
        raise TypeError("it handed out no mask (Packed.of makes one)")
    if output.mask is not None and output.mask.shape != size:
        raise ValueError(f"its mask is {output.mask.shape}, and the image {size}")
    if wrong := [layer.spec.name for layer in output.layers if layer.spec not in specs]:
        raise ValueError(f"it handed out a layer {wrong[0]!r} that it does not announce")
    arrays: list[tuple[str, Any, Held]] = [
        ("image", output.image, KINDS[LayerKind.RGB]),
        ("probability", output.probability, (2, (np.uint16,))),
        *((f"layer {a.spec.name!r}", a.array, KINDS[a.spec.kind]) for a in output.layers),
    ]
    for what, array, (dimensions, types) in arrays:
        if array is None:
            continue
        shape = view.image.shape[:dimensions]
        if array.shape != shape or not any(np.issubdtype(array.dtype, each) for each in types):
            wanted = " or ".join(each.__name__ for each in types)
            raise ValueError(
                f"its {what} is {array.dtype} {array.shape}: it must be {wanted} {shape}"
            )
