"""Tables of TOML files, and the settings that they make."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from itertools import takewhile
from json import dumps
from pathlib import Path
from typing import Any, Final

from pydantic import ConfigDict, TypeAdapter, ValidationError

from roadeval.errors import RoadevalError, SettingError
from roadeval.runtime.documents import read_toml
from roadeval.runtime.files import check_input
from roadeval.runtime.text import is_utf8, likely, visible

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
"""Messages by the beginning of pydantic's name of a problem."""
QUOTED: Final = 60
"""Greatest length of a wrong value in a message."""

_JSON: Final = TypeAdapter(dict[str, Any], config=ConfigDict(ser_json_inf_nan="constants"))


class ConfigError(RoadevalError):
    """A setting that cannot be used."""


@contextmanager
def in_file(where: str) -> Iterator[None]:
    """Add the file ``where``, if any, to errors of the block, and name no flags in them."""
    try:
        yield
    except ConfigError as error:
        if not where:
            raise
        raise ConfigError.of(error, where, in_file=True) from error


def read_tables(path: str | Path, *, trusted: bool = True) -> dict[str, Any]:
    """Read the tables of a TOML file, or of the ``run.toml`` that a recording holds.

    A `ConfigError` if they cannot be read, or name code that may not be loaded; see
    `roadeval.config.run.load_config`.
    """
    file = Path(path)
    text: str | None = ""
    try:
        check_input(file)
        if file.suffix == ".rrd":
            from roadeval.recording.recording import run_toml_in

            text = run_toml_in(file)
        else:
            text = file.read_text(encoding="utf-8-sig")  # a byte order mark may come first
        if text is None:
            problem = "has no configuration because the run was interrupted"
            raise ConfigError(problem, where=file, remedy="replay the drive once more")
        tables = read_toml(text)
    except OSError as error:
        raise ConfigError(f"cannot be read: {error.strerror}", where=file) from error
    except ValueError as error:
        lines = (text or "").splitlines()
        if unfilled := [line for line in lines if line.partition("#")[0].rstrip().endswith("= ?")]:
            problem = f"has no value yet in the line '{unfilled[0].strip()}'"
            raise ConfigError(problem, where=file, remedy="write one in place of the ?") from error
        raise ConfigError(f"cannot be read as TOML: {error}", where=file) from error
    if trusted and file.suffix != ".rrd":
        return tables
    variants = tables.get("variants", {})
    for table in (tables, *(variants.values() if isinstance(variants, Mapping) else ())):
        chain = table.get("chain", ()) if isinstance(table, Mapping) else ()
        for name in chain if isinstance(chain, list) else ():
            if isinstance(name, str) and ":" in name:  # anybody may have made the file
                raise ConfigError(
                    f"its chain names code, {visible(name)}, which is loaded only from a TOML file "
                    "that you give",
                    where=path,
                    remedy="replay the drive with the run.toml of its results",
                )
    return tables


def override(settings: Any, values: Any, table: str) -> Any:
    """Return a settings dataclass, changed by the values of its table.

    A `ConfigError` names the key if it is unknown or its value is not allowed.
    """
    if not isinstance(values, Mapping):
        raise ConfigError("must be a table", setting=table)
    if not values:
        return settings
    _check(values, settings, table)
    merged = _merge(dataclasses.asdict(settings), values)
    try:
        # Strict validation of JSON takes lists for tuples, but neither text nor true for numbers.
        json = _JSON.dump_json(merged, fallback=str)
        return adapter(settings.__class__).validate_json(json, strict=True)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        keys, cause = problem["loc"], problem.get("ctx", {}).get("error")
        # After the number of an item comes the type that pydantic tried for it.
        names = [*map(str, takewhile(lambda part: isinstance(part, str), keys))]
        setting = ".".join((table, *names))
        if isinstance(cause, SettingError) and cause.setting:
            inner = cause.rename_settings(lambda name: f"{setting}.{name}")
            raise ConfigError.of(inner) from error
        item = f"item {int(keys[len(names)]) + 1} " if len(names) < len(keys) else ""
        raise ConfigError(f"{item}{describe_problem(problem)}", setting=setting) from error


@cache
def adapter(kind: type) -> TypeAdapter[Any]:
    """Return pydantic's validator of a settings dataclass, which takes a while to make."""
    return TypeAdapter(kind)


def list_names(names: Iterable[str]) -> str:
    """Return names as a sorted list with commas."""
    return ", ".join(sorted(names))


def quote(value: Any) -> str:
    """Return a value as JSON, shortened for a message.

    >>> quote(True)
    'true'
    """
    text = dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= QUOTED else f"{text[:QUOTED]}..."


def _check(values: Mapping[str, Any], settings: Any, table: str) -> None:
    """Raise a `ConfigError` for an unknown key, or for text that no setting can hold."""
    names = None
    if dataclasses.is_dataclass(settings):
        names = [field.name for field in dataclasses.fields(settings)]
    for key, value in values.items():
        setting = visible(f"{table}.{key}")
        if names is not None and key not in names:
            if not names:
                raise ConfigError(f"{table} has no settings", setting=setting, remedy="remove it")
            choice = f"{likely(key, names)}choose {list_names(names)}"
            raise ConfigError("there is no such setting", setting=setting, remedy=choice)
        items = value if isinstance(value, list | tuple) else (value,)
        texts = [text for text in (key, *items) if isinstance(text, str)]
        if not all(map(is_utf8, texts)):
            problem = "its bytes are not UTF-8, which no configuration can hold"
            remedy = "choose another name, or set PYTHONUTF8=1 if the system has another encoding"
            raise ConfigError(problem, setting=setting, remedy=remedy)
        if any("\0" in text for text in texts):
            raise ConfigError("holds a zero byte, which no name or path may hold", setting=setting)
        if isinstance(value, Mapping):
            _check(value, getattr(settings, key, None), setting)


def _merge(base: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested tables, changed by values."""
    merged = dict(base)
    for key, value in values.items():
        inner = merged.get(key)
        if isinstance(inner, Mapping) and isinstance(value, Mapping):
            merged[key] = _merge(inner, value)
        else:
            merged[key] = value
    return merged


def describe_problem(problem: Mapping[str, Any]) -> str:
    """Return the message for a validation error of pydantic, with the wrong value."""
    entry, context = problem["input"], problem.get("ctx", {})
    plain = (words for kind, words in PLAIN_WORDS.items() if problem["type"].startswith(kind))
    message = str(context.get("error", problem["msg"]))
    message = next(plain, "{}").format(message, **context)
    shown = problem["loc"] and not isinstance(entry, Mapping)
    return f"{message} (given: {quote(entry)})" if shown else message
