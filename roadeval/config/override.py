"""Overriding validated settings, with messages that name the key."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
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
        The file, for messages; without one they name settings between backticks.

    Raises
    ------
    ConfigError
        For an unknown key or a value out of range; names the key.
    """
    values = tables.get(table, {})
    if not isinstance(values, Mapping):
        begin = f"{where}: " if where else ""
        raise ConfigError(f"{begin}[{table}] must be a table")
    if not values:
        return settings
    try:
        return type(settings)(**_merged(dataclasses.asdict(settings), values))
    except ValidationError as error:
        keys, message = _first(error, settings)
        raise ConfigError(named(table, keys, where) + message) from error


def named(table: str, keys: Sequence[str | int], where: str) -> str:
    """Begin a message with the setting that it is about, in a file or on its own.

    >>> named("labels", ("road", 0), "")
    '`labels.road`, item 1: '
    >>> named("post", ("patch", "top"), "wide.toml")
    'wide.toml: [post] patch.top: '
    """
    key = ".".join(part for part in keys if isinstance(part, str))
    items = [part + 1 for part in keys if isinstance(part, int)]
    item = f", item {items[0]}" if items else ""
    if where:
        return f"{where}: [{table}] {key}{item}{': ' if key else ''}"
    return f"`{table}.{key}`{item}: " if key else ""


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


def _first(error: ValidationError, settings: Any) -> tuple[tuple[str | int, ...], str]:
    """Return the first bad key by its parts, and what is wrong; no key where several do not fit."""
    problem = error.errors(include_url=False)[0]
    keys = problem["loc"]
    if problem["type"] == "unexpected_keyword_argument":
        for part in keys[:-1]:
            settings = getattr(settings, str(part))
        names = [entry.name for entry in dataclasses.fields(settings)]
        return keys, f"there is no such setting; choose {either(names)}"
    message = problem["msg"].removeprefix("Value error, ")
    if not keys:
        return keys, message
    given = problem["input"]
    shown = "" if isinstance(given, Mapping) else f" (given: {given!r})"
    return keys, f"{message[0].lower()}{message[1:]}{shown}"
