"""Every stage that a chain may name: roadeval's own, installed ones, and those of a module.

Code of somebody else runs only where its name stands in a ``chain``: as an entry point of the group
``roadeval.stages``, or as ``module:name``, which Python must be able to import.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Final

from roadeval.data import is_plain
from roadeval.errors import RoadevalError
from roadeval.pipeline import beyond, paper
from roadeval.pipeline.function import stage_of_function
from roadeval.pipeline.guard import guarded
from roadeval.pipeline.stage import Stage
from roadeval.runtime.discovery import by_name, found_in
from roadeval.runtime.text import visible

GROUP: Final = "roadeval.stages"
"""The group of entry points by which a package adds stages."""

STAGES: Final[Mapping[str, Stage[Any, Any]]] = by_name(
    (*found_in(beyond, "STAGE"), *found_in(paper, "STAGE"))
)
"""The stages of this package, found by their folder."""


class UnknownStageError(RoadevalError, LookupError):
    """A name in a chain that is no stage: which, and why."""


def names() -> list[str]:
    """List the names that a chain may hold, besides ``module:name``."""
    return [*STAGES, *sorted({each.name for each in entry_points(group=GROUP)} - STAGES.keys())]


def stages_of(chain: Iterable[str]) -> tuple[Stage[Any, Any], ...]:
    """Return the stages that a chain names, in order; an `UnknownStageError` if one is none."""
    return tuple(STAGES.get(name) or _somebodys(name) for name in chain)


@cache
def _somebodys(name: str) -> Stage[Any, Any]:
    """Import a stage that is not this package's own."""
    try:
        found = _imported(name)
        default = name.partition(":")[2].rpartition(".")[2] if ":" in name else name
        file = _file(found)
        if callable(found) and not isinstance(found, type):
            found = stage_of_function(default, found)
        if not isinstance(found, Stage):
            raise TypeError(f"it is {type(found).__name__}, and neither a Stage nor a function")
        _check(found)
    except UnknownStageError:
        raise
    except Exception as error:  # whatever somebody's module raises
        said = visible(" ".join(f"{type(error).__name__}: {error}".split()))
        raise UnknownStageError(f"stage {name!r} cannot be used: {said}") from error
    return _told(guarded(found), name, file)


def _file(found: Any) -> Path | None:
    """Return the file that defines a function or a stage; None where there is none."""
    module = inspect.getmodule(found.bind if isinstance(found, Stage) else found)
    path = getattr(module, "__file__", None)
    return Path(path) if path else None


def _told(stage: Stage[Any, Any], name: str, file: Path | None) -> Stage[Any, Any]:
    """Return a stage that tells results where its code comes from."""
    if file is None:
        return stage
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    told = {"stage": name, "file": file.name, "sha256": digest}
    own = stage.about

    def about(settings: Any) -> Mapping[str, Any]:
        return told if own is None else {**told, **own(settings)}

    return replace(stage, about=about, code=digest)


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


def _check(stage: Stage[Any, Any]) -> None:
    """Raise a ValueError where a stage's names cannot stand in results."""
    if not is_plain(stage.name) or not is_plain(stage.reported):
        raise ValueError(f"its name {stage.name!r} must be of letters, digits, '-' and '_' alone")
    if stage.name in STAGES:
        raise ValueError(f"its name {stage.name!r} is that of a stage of roadeval")
    if stage.fit is not None and stage.parameters is None:
        raise ValueError("it learns, and does not name the type of its parameters")
    for spec in stage.layers(stage.settings()):
        if not is_plain(spec.name):
            raise ValueError(f"the name of its layer {spec.name!r} must be of letters and digits")
