"""Learnt parameters of every variant, and their file: arrays and JSON, no code."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Annotated, Any, Final, Literal, get_args, get_type_hints
from zipfile import ZipFile

import numpy as np
import numpy.typing as npt
from pydantic import Field, ValidationError
from pydantic.dataclasses import dataclass as validated

from roadeval.errors import RoadevalError
from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.stage import Stage, check_arrays, check_range
from roadeval.pipeline.stages import STAGES
from roadeval.results.facts import another_format
from roadeval.runtime.files import check_input, put, writing
from roadeval.version import VERSION as ROADEVAL

FORMAT: Final = "roadeval-model"
VERSION: Final = 11
"""Version of the file, the only one that is read; it grows when a stage's parameters change."""
WROTE: Final = {1: "0.1.0", 2: "0.1.0", 3: "0.2.0"}
"""The version of roadeval by the file's version, for files that do not state it."""
GREATEST_SIZE: Final = 1 << 29
"""Bytes that a model's arrays may take; those of `roadeval train` take a few million."""
Arrays = dict[str, npt.NDArray[Any]]
"""Arrays by name."""
PRIOR: Final = "prior"
"""Name of the array that belongs to no variant."""


@dataclass(frozen=True, eq=False)
class Model:
    """The result of training."""

    parameters: Mapping[str, Mapping[str, Any]]
    """The parameters that each stage has learnt, by variant, then by stage."""
    settings: Mapping[str, Mapping[str, Any]]
    """The settings that training depended on (filters, and stages that learn), by variant."""
    source: str
    """``truth`` or ``patch``; ``none`` if nothing was learnt at all."""
    digests: frozenset[str]
    """Hashes of the frames that trained it (`roadeval.data.Frame.digest`), never evaluated."""
    pixels: int
    """Number of training pixels."""
    prior: npt.NDArray[np.float32] | None = None
    """``(H, W)`` float32: the share of training frames in which a pixel was road. The blind
    baseline is a threshold on it; None without truth."""
    warnings: tuple[str, ...] = ()
    """Doubts that a user should know before believing a result."""
    losses: tuple[str, ...] = ()
    """Parts of the training drives that could not be read; not in the file."""

    def __post_init__(self) -> None:
        if self.prior is not None:
            check_arrays(self, np.float32, prior=("H", "W"))
            check_range("prior", self.prior, 0, 1)

    def require(self, variant: str, pipeline: Pipeline, path: Path) -> None:
        """Raise a `RoadevalError` for a variant that this model was not made for.

        Settings that the parameters do not depend on may differ, and a variant that learns nothing
        needs no model.
        """
        if not pipeline.learning_stages():
            return
        if variant not in self.settings:
            variants = ", ".join(sorted(self.settings))
            problem = f"the model has no variant {variant} (it has {variants})"
            remedy = "train one with the same preset and variants"
            raise RoadevalError(problem, where=path, remedy=remedy)
        # Through JSON, as in the file, where tuples and lists are the same.
        relevant = json.loads(json.dumps(pipeline.relevant_settings()))
        made_for = self.settings[variant]
        for name in sorted({*made_for, *relevant}):
            there, here = made_for.get(name, {}), relevant.get(name, {})
            if there != here:
                keys = [k for k in {**there, **here} if there.get(k) != here.get(k)]
                differ = (f"{k} {there.get(k)} there, {here.get(k)} here" for k in keys)
                raise RoadevalError(
                    f"the model was made for other settings of {name} in variant {variant} "
                    f"({', '.join(differ)})",
                    where=path,
                    remedy="train one with the settings of this run",
                )
        for name in pipeline.learning_stages():
            if name not in self.parameters.get(variant, {}):
                lacking = f"{name} of variant {variant} has learnt nothing"
                problem = f"the model file is incomplete: {lacking}"
                raise RoadevalError(problem, where=path, remedy="train it again")


def save_model(model: Model, path: Path) -> None:
    """Write a model file: a NumPy archive of plain arrays and one JSON text.

    The file appears under its name only when it is complete. The same model gives the same bytes.
    """
    arrays = {
        f"{variant}/{stage}/{name}": array
        for variant, stages in model.parameters.items()
        for stage, parameters in stages.items()
        for name, array in arrays_of(parameters).items()
    }
    if model.prior is not None:
        arrays[PRIOR] = model.prior
    header = {name: getattr(model, name) for name in get_type_hints(_Header)}
    header |= {"format": FORMAT, "version": VERSION, "roadeval": ROADEVAL}
    text = json.dumps(header, sort_keys=True, default=sorted)  # a set has no order
    arrays["header"] = np.frombuffer(text.encode(), np.uint8)
    content = BytesIO()
    np.savez_compressed(content, allow_pickle=False, **arrays)
    with writing(path, RoadevalError):
        put(path, content.getvalue())


def load_model(path: Path, stages: Iterable[Stage] = ()) -> Model:
    """Read a model file; it holds only data, so that a file from elsewhere runs no code.

    A `RoadevalError` if the file is missing, no model, damaged, or of another version, or if it
    holds parameters that no training gives: arrays of a wrong shape, numbers that are not finite.

    Parameters
    ----------
    path
        The file.
    stages
        Further stages whose parameters it may hold, such as
        ``config.pipelines()["mine"].stages()``. A file loads no stage by itself.
    """
    header, arrays = read_archive(path)
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise RoadevalError("not a model file", where=path, remedy="make one with 'roadeval train'")
    if (version := header.get("version")) != VERSION:
        number = version if isinstance(version, int) else 0
        writer = header.get("roadeval") or WROTE.get(number)
        problem = another_format(writer, later=number > VERSION, remedy="train it again")
        raise RoadevalError(problem, where=path)
    try:
        return make_model(header, arrays, {**STAGES, **{stage.name: stage for stage in stages}})
    except ValueError as error:
        reason = str(error)
        if isinstance(error, ValidationError):
            first = error.errors(include_url=False)[0]
            reason = f"{'.'.join(map(str, first['loc']))}: {first['msg'].lower()}"
        problem = f"a damaged model file: {reason}"
        raise RoadevalError(problem, where=path, remedy="train it again") from error


def load_cached_model(path: Path, stages: tuple[Stage, ...]) -> Model:
    """Read a model file as `load_model` does; an unchanged file gives the same model again.

    Then stages can keep what they compute from a model alone, as the SVM's table of colours.
    """
    with suppress(OSError):
        state = path.stat()
        return _load(path, stages, state.st_ino, state.st_size, state.st_mtime_ns)
    return load_model(path)  # this raises the error as a `RoadevalError`


@lru_cache(maxsize=2)
def _load(path: Path, stages: tuple[Stage, ...], *_state: int) -> Model:
    return load_model(path, stages)


def read_archive(path: Path) -> tuple[Any, Arrays]:
    """Return header and arrays of a model file; a `RoadevalError` if it is none."""
    try:
        check_input(path)
        with ZipFile(path) as packed:
            if sum(part.file_size for part in packed.infolist()) > GREATEST_SIZE:
                raise ValueError("no model unpacks to so much")
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        # NumPy returns members that are not arrays as bytes.
        if not all(isinstance(array, np.ndarray) for array in arrays.values()):
            raise ValueError("not all of it is arrays")
        return json.loads(arrays.pop("header").tobytes()), arrays
    except Exception as error:  # four libraries read an archive, each with errors of its own
        if isinstance(error, OSError) and error.strerror:
            raise RoadevalError(f"cannot read the model: {error.strerror}", where=path) from error
        problem, remedy = "not a model file, or a damaged one", "make one with 'roadeval train'"
        raise RoadevalError(problem, where=path, remedy=remedy) from error


@validated(frozen=True)
class _Header:
    """The JSON part of a model file, see `Model`."""

    settings: dict[str, dict[str, dict[str, Any]]]
    source: Literal["truth", "patch", "none"]
    digests: frozenset[str]
    pixels: Annotated[int, Field(ge=0)]
    warnings: tuple[str, ...]


def make_model(content: dict[str, Any], arrays: Arrays, stages: Mapping[str, Stage]) -> Model:
    """Return the model of a file; a ValueError if a part is missing or wrong."""
    fields: dict[str, Any] = {name: content.get(name) for name in get_type_hints(_Header)}
    header = _Header(**fields)
    prior = arrays.pop(PRIOR, None)
    parts: dict[tuple[str, str], Arrays] = {}
    for name, array in arrays.items():
        variant, stage, entry = (*name.split("/", 2), "", "")[:3]
        if variant not in header.settings:
            raise ValueError(f"array {name} belongs to no variant")
        parts.setdefault((variant, stage), {})[entry] = array
    parameters: dict[str, dict[str, Any]] = {variant: {} for variant in header.settings}
    for (variant, stage), part in parts.items():
        if stage not in stages or (kind := stages[stage].parameters) is None:
            raise ValueError(f"{variant}/{stage} is not a stage that learns")
        try:
            parameters[variant][stage] = from_arrays(kind, part)
        except ValueError as error:
            raise ValueError(f"{variant}/{stage}: {error}") from error
    return Model(parameters, **vars(header), prior=prior)


def arrays_of(learnt: Any) -> Arrays:
    """Return the fields of a dataclass as arrays by name.

    The arrays of an inner dataclass are ``field/name``; a field that is None has none.
    """
    arrays: Arrays = {}
    for field in dataclasses.fields(learnt):
        value = getattr(learnt, field.name)
        if dataclasses.is_dataclass(value):
            arrays |= {f"{field.name}/{name}": array for name, array in arrays_of(value).items()}
        elif value is not None:
            arrays[field.name] = np.asarray(value)
    return arrays


def from_arrays(kind: type[Any], arrays: Arrays) -> Any:
    """Return the dataclass with these arrays, the inverse of `arrays_of`.

    A `ValueError` if an array is missing or unknown, or the dataclass refuses it.
    """
    inner_kinds = inner_dataclasses(kind)
    names = {field.name for field in dataclasses.fields(kind)} - inner_kinds.keys()
    outer = {name for name in arrays if "/" not in name or name.split("/")[0] not in inner_kinds}
    if wrong := names ^ outer:
        raise ValueError(f"missing or unknown arrays: {', '.join(sorted(wrong))}")
    values: dict[str, Any] = {name: arrays[name] for name in names}
    values |= {name: array.item() for name, array in values.items() if not array.ndim}
    for name, (inner_kind, optional) in inner_kinds.items():
        start = f"{name}/"
        inner = {key.removeprefix(start): arrays[key] for key in arrays if key.startswith(start)}
        values[name] = from_arrays(inner_kind, inner) if inner or not optional else None
    return kind(**values)


def inner_dataclasses(kind: type[Any]) -> dict[str, tuple[type[Any], bool]]:
    """Return the fields of a dataclass that are dataclasses, and whether each may be None."""
    try:
        hints = get_type_hints(kind)
    except NameError:  # a user's stage may import names for type checkers alone
        return {}
    return {
        name: (choice, type(None) in get_args(hint))
        for name, hint in hints.items()
        for choice in get_args(hint) or (hint,)
        if dataclasses.is_dataclass(choice) and isinstance(choice, type)
    }
