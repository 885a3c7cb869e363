"""From the tables of a TOML file to settings; messages name the file and the key."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import takewhile
from json import dumps
from pathlib import Path
from typing import Any, Final

from pydantic import ConfigDict, TypeAdapter, ValidationError

from roadeval.errors import RoadevalError
from roadeval.runtime.documents import read_toml
from roadeval.runtime.files import check_input
from roadeval.runtime.text import is_utf8, visible

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
"""Messages by the beginning of the validating library's name of a problem."""
NOT_UTF8: Final = (
    "its bytes are not UTF-8, which no configuration can hold: choose another name, or set "
    "PYTHONUTF8=1 where the system speaks another encoding"
)
QUOTED: Final = 60
"""Letters of a wrong value that a message quotes."""

_JSON: Final = TypeAdapter(dict[str, Any], config=ConfigDict(ser_json_inf_nan="constants"))

Keys = tuple[str | int, ...]
"""The names, and the numbers of items, that lead to a value."""


class ConfigError(RoadevalError):
    """A setting that cannot be used: which file, which key, and what is allowed."""


@contextmanager
def in_file(where: str) -> Iterator[None]:
    """Begin the message of a `ConfigError` in the block with a file, or another place, if any.

    In a file a setting is not marked as one that a flag may set.
    """
    try:
        yield
    except ConfigError as error:
        if not where:
            raise
        raise ConfigError(f"{where}: {str(error).replace('`', '')}") from error


def read_tables(path: str | Path, *, trusted: bool = True) -> dict[str, Any]:
    """Read the tables of a TOML file, or of the ``run.toml`` that a recording holds.

    A `ConfigError` if there are none to read, or they name code that may not be loaded: see
    `roadeval.config.run.load_config`.
    """
    try:
        tables = read_toml(_text(Path(path)))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ConfigError(f"{path}: cannot be read as TOML: {error}") from error
    if not trusted or Path(path).suffix == ".rrd":
        _refuse_code(tables, path)
    return tables


def _refuse_code(tables: Mapping[str, Any], path: str | Path) -> None:
    """Raise a `ConfigError` for a chain that names a module: the file may be anybody's."""
    variants = tables.get("variants", {})
    asked = [tables, *(variants.values() if isinstance(variants, Mapping) else ())]
    for each in asked:
        chain = each.get("chain", ()) if isinstance(each, Mapping) else ()
        for name in chain if isinstance(chain, list) else ():
            if isinstance(name, str) and ":" in name:
                raise ConfigError(
                    f"{path}: its chain names code, {visible(name)}, which is loaded only from a "
                    "TOML file that you give: replay the drive with the run.toml of its results"
                )


def _text(path: Path) -> str:
    check_input(path)
    if path.suffix != ".rrd":
        return path.read_text(encoding="utf-8-sig")  # some editors begin a file with a mark
    from roadeval.recording.recording import run_toml_in

    text = run_toml_in(path)
    if text is None:
        raise ConfigError(
            f"{path}: holds no configuration, for the run was cut: replay the drive once with its "
            "options, and that recording holds them"
        )
    return text


def override(settings: Any, values: Any, table: str) -> Any:
    """Return a settings dataclass with the values of its table in place, validated as a whole.

    A `ConfigError` for an unknown key or a value out of range names the key.
    """
    if not isinstance(values, Mapping):
        raise ConfigError(f"`{table}`: must be a table")
    if not values:
        return settings
    if problem := _unusable(values, settings):
        raise ConfigError(_named(table, *problem))
    merged = _merged(dataclasses.asdict(settings), values)
    try:
        # In JSON a strict check accepts a list for a tuple, but no text for a number, and no true.
        json = _JSON.dump_json(merged, fallback=str)
        return adapter(settings.__class__).validate_json(json, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ConfigError(_named(table, first["loc"], _plainly(first))) from error


@cache
def adapter(kind: type) -> TypeAdapter[Any]:
    """Return what validates a settings dataclass and has its schema: to make it takes a while."""
    return TypeAdapter(kind)


def either(names: Iterable[str]) -> str:
    """List names to choose from."""
    return ", ".join(sorted(names))


def quoted(value: Any) -> str:
    """Write a value as in a file, shortened for a message.

    >>> quoted(True)
    'true'
    """
    text = dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= QUOTED else f"{text[:QUOTED]}..."


def _named(table: str, keys: Sequence[str | int], problem: str) -> str:
    """Name the setting that a problem is about, unless the problem does.

    >>> _named("labels", ("road", 0), "must be text")
    '`labels.road`, item 1: must be text'
    """
    # After an item's number comes which of its types the validating library tried.
    names = list(takewhile(lambda part: isinstance(part, str), keys))
    item = f", item {int(keys[len(names)]) + 1}" if len(names) < len(keys) else ""
    if not keys and "`" in problem:
        return problem
    return f"`{'.'.join(map(str, (table, *names)))}`{item}: {problem}"


def _unusable(values: Mapping[str, Any], settings: Any, keys: Keys = ()) -> tuple[Keys, str] | None:
    """Return the first key without a setting, or with text that none can hold, and the problem."""
    known = None
    if dataclasses.is_dataclass(settings):
        known = [field.name for field in dataclasses.fields(settings)]
    for key, value in values.items():
        here = (*keys, key)
        if known is not None and key not in known:
            choice = f"there is no such setting; choose {either(known)}"
            return here, choice if known else "it has no settings"
        if isinstance(value, Mapping):
            if problem := _unusable(value, getattr(settings, key, None), here):
                return problem
        elif isinstance(value, str):
            if not is_utf8(value):
                return here, NOT_UTF8
            if "\0" in value:
                return here, "holds a zero byte, which no name and no path can"
    return None


def _merged(base: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in values.items():
        inner = merged.get(key)
        if isinstance(inner, Mapping) and isinstance(value, Mapping):
            merged[key] = _merged(inner, value)
        else:
            merged[key] = value
    return merged


def _plainly(problem: Mapping[str, Any]) -> str:
    """Describe a problem in plain words, with the value that was given."""
    message, given = str(problem["msg"]).removeprefix("Value error, "), problem["input"]
    for begin, words in PLAIN_WORDS.items():
        if problem["type"].startswith(begin):
            message = words.format_map(problem.get("ctx", {}))
            break
    shown = problem["loc"] and not isinstance(given, Mapping)
    return f"{message} (given: {quoted(given)})" if shown else message
