"""Overriding validated settings, with messages that name the key."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import takewhile
from json import dumps
from typing import Any, Final

from pydantic import ConfigDict, TypeAdapter, ValidationError

from roadeval.config.errors import ConfigError
from roadeval.runtime.text import is_utf8

PLAIN_WORDS: Final[Mapping[str, str]] = {
    "int_": "must be a whole number",
    "float_": "must be a number",
    "finite_number": "must be a finite number",
    "bool_": "must be true or false",
    "string_pattern": "must match {pattern}",
    "string_": "must be text",
    "tuple_type": "must be a list",
    "dict_type": "must be a table",
    "dataclass_type": "must be a table",
    "greater_than_equal": "must be at least {ge}",
    "greater_than": "must be above {gt}",
    "less_than_equal": "must be at most {le}",
    "less_than": "must be below {lt}",
    "literal_error": "must be {expected}",
    "too_long": "must be a list of at most {max_length}",
    "missing": "is too short a list",
}
"""What is wrong with a value, by how the validating library's name of the problem begins."""
NOT_UTF8: Final = (
    "its bytes are not UTF-8, which no configuration can hold: choose another name, or set "
    "PYTHONUTF8=1 where the system speaks another encoding"
)
NUL: Final = "holds a zero byte, which no name and no path can"
QUOTED: Final = 60
"""Letters of a wrong value that a message quotes."""

_JSON: Final = TypeAdapter(dict[str, Any], config=ConfigDict(ser_json_inf_nan="constants"))


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
    merged = _merged(dataclasses.asdict(settings), values)
    known = [entry.name for entry in dataclasses.fields(settings)]
    for key in merged.keys() - {*known}:
        raise ConfigError(named(table, (key,), where) + _unknown(known))
    for path, text in _texts(merged):
        if not is_utf8(text):
            raise ConfigError(named(table, path, where) + NOT_UTF8)
        if "\0" in text:
            raise ConfigError(named(table, path, where) + NUL)
    try:
        # As JSON, for then a list is a tuple and a table a dataclass, but true is no number.
        json = _JSON.dump_json(merged, fallback=str)
        return TypeAdapter(type(settings)).validate_json(json, strict=True)
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
    # After an item's number comes which of its types the validating library tried.
    names = list(takewhile(lambda part: isinstance(part, str), keys))
    key, rest = ".".join(map(str, names)), keys[len(names) :]
    item = f", item {int(rest[0]) + 1}" if rest else ""
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
        return keys, _unknown(names)
    if problem["type"] == "value_error":
        message = problem["msg"].removeprefix("Value error, ")
    else:
        message = _plainly(problem)
    given = problem["input"]
    shown = "" if not keys or isinstance(given, Mapping) else f" (given: {quoted(given)})"
    return keys, f"{message}{shown}"


def _unknown(names: Iterable[str]) -> str:
    return f"there is no such setting; choose {either(names)}" if names else "it has no settings"


def quoted(value: Any) -> str:
    """Write a value as it stands in a file, and no more of it than a message can hold.

    >>> quoted(True)
    'true'
    """
    text = dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= QUOTED else f"{text[:QUOTED]}..."


def _plainly(problem: Mapping[str, Any]) -> str:
    """Say what a value must be, in other words than the validating library's."""
    facts = problem.get("ctx", {})
    for begin, words in PLAIN_WORDS.items():
        if problem["type"].startswith(begin):
            return words.format_map(facts)
    return str(problem["msg"])


def _texts(
    values: Mapping[str, Any], keys: tuple[str | int, ...] = ()
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Yield every text in tables, with the keys that lead to it."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _texts(value, (*keys, key))
        elif isinstance(value, str):
            yield (*keys, key), value
