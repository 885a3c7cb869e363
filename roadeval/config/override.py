"""Overriding validated settings, with messages that name the key."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import ValidationError

from roadeval.config.errors import ConfigError


def override(settings: Any, tables: Mapping[str, Any], table: str, where: str = "") -> Any:
    """Return a settings dataclass with the values of one table in place, validated as a whole.

    Parameters
    ----------
    settings
        A validated dataclass.
    tables
        Tables by name; that of this name may be missing.
    table
        The name of the settings' table.
    where
        The file, for messages; without one they name settings as ``table.key``.

    Raises
    ------
    ConfigError
        For an unknown key or a value out of range; names the key.
    """
    values = tables.get(table, {})
    if not isinstance(values, Mapping):
        raise ConfigError(f"{where}: [{table}] must be a table" if where else f"{table}: a table")
    if not values:
        return settings
    try:
        return type(settings)(**_merged(dataclasses.asdict(settings), values))
    except ValidationError as error:
        key, message = _first(error, settings)
        name = f"{where}: [{table}] {key}" if where else f"{table}.{key}" if key else ""
        raise ConfigError(f"{name}{': ' if key else ''}{message}") from error


def either(names: Iterable[str]) -> str:
    """List names to choose from."""
    return ", ".join(sorted(names))


def _merged(base: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in values.items():
        inner = merged.get(key)
        if isinstance(inner, Mapping) and isinstance(value, Mapping):
            merged[key] = _merged(inner, value)
        else:
            merged[key] = value
    return merged


def _first(error: ValidationError, settings: Any) -> tuple[str, str]:
    """Return the first bad key and what is wrong with it; no key where several do not fit."""
    problem = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in problem["loc"])
    if problem["type"] == "unexpected_keyword_argument":
        names = [entry.name for entry in dataclasses.fields(settings)]
        return key, f"there is no such setting; choose {either(names)}"
    message = problem["msg"].removeprefix("Value error, ")
    if not key:
        return key, message
    given = problem["input"]
    shown = "" if isinstance(given, Mapping) else f" (given: {given!r})"
    return key, f"{message[0].lower()}{message[1:]}{shown}"
