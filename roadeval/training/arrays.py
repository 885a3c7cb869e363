"""Conversion of what a stage has learnt to named arrays, as model files hold them, and back."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, get_args, get_type_hints

import numpy as np
import numpy.typing as npt

Arrays = Mapping[str, npt.NDArray[Any]]
"""Those of a dataclass by name."""


def arrays_of(learnt: Any) -> dict[str, npt.NDArray[Any]]:
    """Return the fields of a dataclass as arrays by name.

    Those of a field that is a dataclass, too, are ``field/name``; a part that is None has none.
    """
    found: dict[str, npt.NDArray[Any]] = {}
    parts = _parts(type(learnt))
    for field in dataclasses.fields(learnt):
        value = getattr(learnt, field.name)
        if field.name not in parts:
            found[field.name] = np.asarray(value)
        elif value is not None:
            found |= {f"{field.name}/{name}": array for name, array in arrays_of(value).items()}
    return found


def from_arrays(kind: type[Any], arrays: Arrays) -> Any:
    """Return the dataclass whose arrays these are, see `arrays_of`.

    Raises
    ------
    ValueError
        If an array is missing, or is not known, or the dataclass refuses what it is given.
    """
    parts = _parts(kind)
    names = {field.name for field in dataclasses.fields(kind)}
    own = names - parts.keys()
    whole = {name for name in arrays if name.partition("/")[0] not in parts or name in parts}
    if wrong := own ^ whole:
        raise ValueError(f"missing or unknown arrays: {', '.join(sorted(wrong))}")
    values: dict[str, Any] = {}
    for name in names:
        if name not in parts:
            array = arrays[name]
            values[name] = array if array.ndim else array.item()
            continue
        of_part, optional = parts[name]
        start = f"{name}/"
        inner = {key.removeprefix(start): arrays[key] for key in arrays if key.startswith(start)}
        values[name] = from_arrays(of_part, inner) if inner or not optional else None
    return kind(**values)


def _parts(kind: type[Any]) -> dict[str, tuple[type[Any], bool]]:
    """Return those fields of a dataclass that are dataclasses, and whether each may be None."""
    try:
        hints = get_type_hints(kind)
    except NameError:  # of names that type checkers alone import: a user's stage may have such
        return {}
    found = {}
    for field in dataclasses.fields(kind):
        choices = get_args(hints[field.name]) or (hints[field.name],)
        for choice in choices:
            if dataclasses.is_dataclass(choice) and isinstance(choice, type):
                found[field.name] = choice, type(None) in choices
    return found
