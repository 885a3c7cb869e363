"""Every stage that a chain may name: roadeval's own, those of other packages and of modules.

Code from outside runs only if a ``chain`` names it: as an entry point of the group
``roadeval.stages``, or as ``module:name``, which Python must be able to import.
"""

from __future__ import annotations

import inspect
import re
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import is_dataclass, replace
from functools import cache
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.data import CERTAIN, Layer, LayerKind, LayerSpec, Packed, is_plain, mask_spec
from roadeval.errors import RoadevalError
from roadeval.pipeline import beyond, paper
from roadeval.pipeline.stage import NoSettings, Output, Stage, StageError, View, per_view
from roadeval.runtime.discovery import by_name, collect, one_line, points_of
from roadeval.runtime.files import sha256_of

STAGES: Final[Mapping[str, Stage]] = by_name((*collect(beyond, "STAGE"), *collect(paper, "STAGE")))
"""The stages of this package, one per file of their folders."""


PACKAGE: Final = Path(__file__).parents[1]
"""The folder of roadeval itself."""
ARGUMENTS: Final = ("image", "moment", "settings")
"""The names of the arguments that a function may have."""


class UnknownStageError(RoadevalError, LookupError):
    """A name in a chain that is not a stage: which, and why."""


@cache
def names() -> tuple[str, ...]:
    """Return the names that a chain may hold, besides ``module:name``."""
    return (*STAGES, *sorted(points_of("stages").names - STAGES.keys()))


def stages_of(chain: Iterable[str]) -> tuple[Stage, ...]:
    """Return the stages that a chain names, in order; an `UnknownStageError` if one is none."""
    return tuple(STAGES.get(name) or import_stage(name) for name in chain)


@cache
def import_stage(name: str) -> Stage:
    """Import a stage from outside this package; its results say which file defines it."""
    try:
        stage = _import_object(name)
        module = inspect.getmodule(stage.bind if isinstance(stage, Stage) else stage)
        if callable(stage) and not isinstance(stage, type):
            stage = stage_of_function(re.split("[:.]", name)[-1], stage)
        if not isinstance(stage, Stage):
            raise TypeError(f"it is {type(stage).__name__}, and neither a Stage nor a function")
        check_stage(stage)
        if (file := getattr(module, "__file__", None)) is None:
            return guard(replace(stage, code=""))
        origin = {"stage": name, "file": Path(file).name, "sha256": sha256_of(Path(file))}
        facts = stage.about

        def about(settings: Any) -> Mapping[str, Any]:
            return {**origin, **(facts(settings) if facts else {})}

        return guard(replace(stage, about=about, code=origin["sha256"]))
    except UnknownStageError:
        raise
    except (Exception, SystemExit) as error:  # a module from outside may raise anything
        raise UnknownStageError(f"stage {name!r} cannot be used: {one_line(error)}") from error


def _import_object(name: str) -> Any:
    """Import the object of an entry point or of ``module:name``."""
    module, _, attributes = name.partition(":")
    if not attributes:
        points = points_of("stages").select(name=name)
        if not points:
            raise UnknownStageError(f"there is no stage {name!r}; choose {', '.join(names())}")
        return next(iter(points)).load()
    try:
        return attrgetter(attributes)(import_module(module))
    except ModuleNotFoundError as error:
        raise UnknownStageError(
            f"stage {name!r}: there is no module {error.name}: install it, or name its folder in "
            "PYTHONPATH"
        ) from error


def check_stage(stage: Stage) -> None:
    """Raise a ValueError if a stage's names cannot stand in results, or its model in a file."""
    for name in (stage.name, *(spec.name for spec in stage.specs(stage.settings()))):
        if not is_plain(name):
            raise ValueError(f"its name {name!r} must be of letters, digits, '-' and '_' alone")
    if stage.name in STAGES:
        raise ValueError(f"its name {stage.name!r} is that of a stage of roadeval")
    if stage.fit is not None and stage.parameters is None:
        raise ValueError("it learns, but does not name the type of its parameters")


def stage_of_function(name: str, function: Callable[..., Any]) -> Stage:
    """Return the stage of a function from an image to a road mask.

    A `TypeError` if it has other arguments. The function's arguments are passed by name: ``image``,
    ``(H, W, 3)`` uint8 RGB; ``moment``, a `roadeval.data.Moment`, or None for an image by itself;
    and ``settings``, whose default is an instance of a dataclass. It returns ``(H, W)`` bool or
    integers, 0 and one level for road; or floats from 0 to 1, the probability of road, which is
    road above one half.
    """
    arguments = inspect.signature(function).parameters
    for argument, about in arguments.items():
        if argument not in ARGUMENTS and about.default is about.empty:
            raise TypeError(f"its argument {argument} is none of {', '.join(ARGUMENTS)}")
    if "image" not in arguments:
        raise TypeError("it has no argument image")
    default = arguments["settings"].default if "settings" in arguments else NoSettings()
    if isinstance(default, type) or not is_dataclass(default):
        raise TypeError("the default of its argument settings is not an instance of a dataclass")
    first_line = (inspect.getdoc(function) or "").partition("\n")[0].rstrip(".")
    spec = mask_spec(name, first_line or name)

    @per_view
    def bind(settings: Any, _learnt: None, view: View) -> Output:
        """Call the function, and return its mask as an output."""
        values = {"image": view.image.copy(), "moment": view.moment, "settings": settings}
        array = np.asarray(function(**{key: values[key] for key in values if key in arguments}))
        codes = None
        if array.ndim != 2 or array.dtype.kind not in "biuf":
            raise ValueError(f"it returned {array.dtype} {array.shape}, not an (H, W) mask")
        if array.dtype.kind == "f":
            if not ((array >= 0) & (array <= 1)).all():
                raise ValueError("it returned floats that are not probabilities, from 0 to 1")
            product = np.multiply(array, CERTAIN, dtype=np.result_type(array, np.float32))
            codes = np.rint(product).astype(np.uint16)  # float16 does not hold 65535
            array = codes > round(CERTAIN / 2)
        elif array.size and not np.isin(array, (0, max(array.max(), 1))).all():
            problem = "it returned whole numbers that are not a mask of 0 and one other level"
            raise ValueError(problem)
        mask = Packed.of(array != 0)
        return Output((Layer(spec, mask),), mask=mask, probability=codes)

    return Stage(name, spec.title, type(default), bind, (spec,))


def guard(stage: Stage) -> Stage:
    """Return a stage whose errors are `StageError`; a wrong output is such an error, too."""

    def name_errors(problem: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that does the same work, and names the stage in errors."""

        def run(*arguments: Any) -> Any:
            try:
                return work(*arguments)
            except (RoadevalError, MemoryError):
                raise
            except (Exception, SystemExit) as error:  # code from outside may raise anything
                message = f"{one_line(error)}{_place(error)}"
                raise StageError(f"stage {stage.name} {problem}: {message}") from error

        return run

    def bind(settings: Any, parameters: Any) -> Callable[[View], Output]:
        """Bind the stage to a function that checks its outputs."""
        run, specs = stage.bind(settings, parameters), stage.specs(settings)

        def run_checked(view: View) -> Output:
            locked = {name: getattr(view, name).view() for name in ("original", "image")}
            for image in locked.values():
                image.flags.writeable = False  # the other variants see it, too
            output = run(replace(view, **locked))
            check_output(output, view, stage, specs)
            return output

        return name_errors("failed", run_checked)

    fit = stage.fit and name_errors("cannot learn", stage.fit)
    adapt = stage.adapt and name_errors("cannot learn further", stage.adapt)
    oracle = stage.oracle and name_errors("failed with the truth", stage.oracle)
    bind = name_errors("cannot be made ready", bind)
    return replace(stage, bind=bind, fit=fit, adapt=adapt, oracle=oracle)


def _place(error: BaseException) -> str:
    """Return file and line of an error in code from outside, as `` (mine.py:12)``; else nothing."""
    lines = traceback.extract_tb(error.__traceback__)
    outside = [line for line in lines if PACKAGE not in Path(line.filename).parents]
    last = [line for line in outside if line.filename == outside[0].filename][-1:]
    return "".join(f" ({Path(line.filename).name}:{line.lineno})" for line in last)


ArrayKind = tuple[int, tuple[type[np.generic], ...]]
"""Dimensions of an array, and the types that it may have."""
KINDS: Final[Mapping[LayerKind, ArrayKind]] = {
    LayerKind.MASK: (2, (np.bool_, np.integer)),
    LayerKind.LABELS: (2, (np.uint8,)),
    LayerKind.RGB: (3, (np.uint8,)),
    LayerKind.SCALAR: (2, (np.number, np.bool_)),
}
"""Dimensions and types of the arrays that a recording can hold, by the kind of layer."""


def check_output(output: Output, view: View, stage: Stage, specs: tuple[LayerSpec, ...]) -> None:
    """Raise an error if this is not an output, or one of its arrays has a wrong size or type."""
    if not isinstance(output, Output):
        raise TypeError(f"it returned {type(output).__name__}, not Output")
    size = view.image.shape[:2]
    if stage.yields_mask and not isinstance(output.mask, Packed):
        raise TypeError("it returned no mask (Packed.of makes one)")
    if output.mask is not None and output.mask.shape != size:
        raise ValueError(f"its mask is {output.mask.shape}, and the image {size}")
    if wrong := [layer.spec.name for layer in output.layers if layer.spec not in specs]:
        raise ValueError(f"it returned a layer {wrong[0]!r} that its stage does not list")
    arrays: list[tuple[str, Any, ArrayKind]] = [
        ("image", output.image, KINDS[LayerKind.RGB]),
        ("probability", output.probability, (2, (np.uint16,))),
        *((f"layer {a.spec.name!r}", a.array, KINDS[a.spec.kind]) for a in output.layers),
    ]
    for name, array, (dimensions, types) in arrays:
        if array is None:
            continue
        shape = view.image.shape[:dimensions]
        if array.shape != shape or not any(np.issubdtype(array.dtype, kind) for kind in types):
            kinds = " or ".join(kind.__name__ for kind in types)
            made = f"{array.dtype} {array.shape}"
            raise ValueError(f"its {name} is {made}: it must be {kinds} {shape}")
