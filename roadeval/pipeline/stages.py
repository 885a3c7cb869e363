"""Every stage that a chain may name: roadeval's own, installed ones, and those of a module.

Code of somebody else runs only where its name stands in a ``chain``: as an entry point of the group
``roadeval.stages``, or as ``module:name``, which Python must be able to import.
"""

from __future__ import annotations

import dataclasses
import inspect
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.data import CERTAIN, Layer, LayerKind, LayerSpec, Packed, is_plain, mask_spec
from roadeval.errors import RoadevalError
from roadeval.pipeline import beyond, paper
from roadeval.pipeline.stage import Output, Stage, StageError, TrainingSet, View
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
    return [*STAGES, *sorted({each.name for each in entry_points(group=GROUP)} - STAGES.keys())]


def stages_of(chain: Iterable[str]) -> tuple[Stage, ...]:
    """Return the stages that a chain names, in order; an `UnknownStageError` if one is none."""
    return tuple(STAGES.get(name) or _somebodys(name) for name in chain)


@cache
def _somebodys(name: str) -> Stage:
    """Import a stage that is not this package's own."""
    try:
        found = _imported(name)
        default = name.partition(":")[2].rpartition(".")[2] if ":" in name else name
        module = inspect.getmodule(found.bind if isinstance(found, Stage) else found)
        if callable(found) and not isinstance(found, type):
            found = stage_of_function(default, found)
        if not isinstance(found, Stage):
            raise TypeError(f"it is {type(found).__name__}, and neither a Stage nor a function")
        _check(found)
        return _with_origin(guarded(found), name, getattr(module, "__file__", None))
    except UnknownStageError:
        raise
    except Exception as error:  # whatever somebody's module raises
        said = visible(" ".join(f"{type(error).__name__}: {error}".split()))
        raise UnknownStageError(f"stage {name!r} cannot be used: {said}") from error


def _with_origin(stage: Stage, name: str, file: str | None) -> Stage:
    """Return a stage whose results say which file defines it."""
    if file is None:
        return replace(stage, code="")
    origin = {"stage": name, "file": Path(file).name, "sha256": sha256_of(Path(file))}
    own = stage.about

    def about(settings: Any) -> Mapping[str, Any]:
        return {**origin, **(own(settings) if own else {})}

    return replace(stage, about=about, code=origin["sha256"])


def _imported(name: str) -> Any:
    if ":" not in name:
        points = entry_points(group=GROUP, name=name)
        if not points:
            raise UnknownStageError(f"there is no stage {name!r}; choose {', '.join(names())}")
        return next(iter(points)).load()
    module, _, attributes = name.partition(":")
    try:
        found = import_module(module)
    except ModuleNotFoundError as error:
        raise UnknownStageError(
            f"stage {name!r}: there is no module {error.name}: install it, or name its folder in "
            "PYTHONPATH"
        ) from error
    for attribute in attributes.split("."):
        found = getattr(found, attribute)
    return found


def _check(stage: Stage) -> None:
    """Raise a ValueError where a stage's names cannot stand in results."""
    if not is_plain(stage.name):
        raise ValueError(f"its name {stage.name!r} must be of letters, digits, '-' and '_' alone")
    if stage.name in STAGES:
        raise ValueError(f"its name {stage.name!r} is that of a stage of roadeval")
    if stage.fit is not None and stage.parameters is None:
        raise ValueError("it learns, and does not name the type of its parameters")
    for spec in stage.specs(stage.settings()):
        if not is_plain(spec.name):
            raise ValueError(f"the name of its layer {spec.name!r} must be of letters and digits")


@dataclass(frozen=True)
class NoSettings:
    """Settings of a function that has none."""


def stage_of_function(name: str, function: Callable[..., Any]) -> Stage:
    """Return the stage of a function from an image to a road mask.

    A `TypeError` if it has other arguments. The function's arguments are given by their names:
    ``image``, ``(H, W, 3)`` uint8 RGB; ``moment``, a `roadeval.data.Moment`, or None for an image
    by itself; and ``settings``, whose default is an instance of a dataclass. It returns ``(H, W)``
    bool or whole numbers, nonzero where road is; or floats from 0 to 1, how probable road is, whose
    mask is what is above one half; or an `Output` without layers other than its mask.
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
    spec = mask_spec(
        name, ((inspect.getdoc(function) or name).partition("\n")[0].rstrip(".") or name)
    )

    def bind(values: Any, _parameters: None) -> Callable[[View], Output]:
        given = {"settings": values} if "settings" in arguments else {}

        def run(view: View) -> Output:
            seen = {"moment": view.moment} if "moment" in arguments else {}
            return _output(function(image=view.image, **seen, **given), spec)

        return run

    return Stage(name, spec.title, settings, bind, (spec,))


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
    codes = np.rint(array * CERTAIN).astype(np.uint16)
    mask = Packed.of(codes > round(CERTAIN / 2))
    return Output((Layer(spec, mask),), mask=mask, probability=codes)


def guarded(stage: Stage) -> Stage:
    """Return a stage whose every error is a `StageError`, and so is an output that cannot be."""

    def bind(settings: Any, parameters: Any) -> Callable[[View], Output]:
        with _named(stage, "cannot be made ready"):
            run = stage.bind(settings, parameters)
            specs = stage.specs(settings)

        def checked(view: View) -> Output:
            with _named(stage, "failed"):
                output = run(view)
                _check_output(output, view, stage, specs)
            return output

        return checked

    def fit(training_set: TrainingSet, settings: Any) -> Any:
        assert stage.fit is not None
        with _named(stage, "cannot learn"):
            return stage.fit(training_set, settings)

    return replace(stage, bind=bind, fit=None if stage.fit is None else fit)


@contextmanager
def _named(stage: Stage, what: str) -> Iterator[None]:
    try:
        yield
    except (RoadevalError, MemoryError):
        raise
    except Exception as error:  # whatever somebody's code raises
        said = visible(" ".join(f"{type(error).__name__}: {error}".split()))
        raise StageError(f"stage {stage.name} {what}: {said}{_place(error)}") from error


def _place(error: Exception) -> str:
    """Return where in somebody's file an error arose, as `` (mine.py:12)``; else nothing."""
    frames = traceback.extract_tb(error.__traceback__)
    others = [each for each in frames if PACKAGE not in Path(each.filename).parents]
    own = [each for each in others if each.filename == others[0].filename]
    return f" ({Path(own[-1].filename).name}:{own[-1].lineno})" if own else ""


def _check_output(output: Output, view: View, stage: Stage, specs: tuple[LayerSpec, ...]) -> None:
    """Raise an error where an output is none, or not of the image's size."""
    if not isinstance(output, Output):
        raise TypeError(f"it returned {type(output).__name__} and no Output")
    size = view.image.shape[:2]
    if stage.yields_mask and not isinstance(output.mask, Packed):
        raise TypeError("it handed out no mask (Packed.of makes one)")
    if output.mask is not None and output.mask.shape != size:
        raise ValueError(f"its mask is {output.mask.shape}, and the image {size}")
    image, codes = output.image, output.probability
    if image is not None and (image.shape != view.image.shape or image.dtype != np.uint8):
        raise ValueError(f"its image is {image.dtype} {image.shape}, not uint8 {view.image.shape}")
    if codes is not None and (codes.shape != size or codes.dtype != np.uint16):
        raise ValueError(f"its probability is {codes.dtype} {codes.shape}, not uint16 {size}")
    for layer in output.layers:
        if layer.spec not in specs:
            raise ValueError(f"it handed out a layer {layer.spec.name!r} that it does not announce")
        _check_layer(layer, size)


def _check_layer(layer: Layer, size: tuple[int, int]) -> None:
    """Raise an error where a layer is not of the image's size, or of a type that no codec takes."""
    name, kind, array = layer.spec.name, layer.spec.kind, layer.array
    if array.shape[:2] != size:
        raise ValueError(f"its layer {name!r} is {array.shape}, not {size}")
    if kind is LayerKind.MASK and array.dtype.kind not in "biu":
        raise TypeError(f"its layer {name!r} holds {array.dtype}, and no whole numbers")
    if kind in (LayerKind.LABELS, LayerKind.RGB) and array.dtype != np.uint8:
        raise TypeError(f"its layer {name!r} holds {array.dtype}, not uint8")
