"""JSON, TOML, YAML and Protocol Buffers from elsewhere, read within limits.

A few kilobytes can nest deeper than any program unpacks, name a table by twenty thousand words, or
hold a word that takes minutes to typeset.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from roadeval.runtime.files import check_input

LONGEST: Final = 12_000
"""Letters of a text."""
LONG: Final = 1_000
LONG_TOGETHER: Final = 500_000
"""Letters of all texts of more than `LONG` letters."""
LISTED: Final = 1_000_000
"""Letters of the texts of a list."""
VALUES: Final = 2_000_000
DEPTH: Final = 32
"""Tables and lists inside one another."""
_TOO_DEEP: Final = f"it nests more than {DEPTH} tables and lists inside one another"
BYTES: Final = 64 << 20
TOML_BYTES: Final = 1 << 20
YAML_BYTES: Final = 1 << 17
DOTS: Final = 2_000
"""Parts of a name in TOML; the time to read one grows with the square of their number."""


def read_bounded(path: Path, most: int = BYTES) -> bytes:
    """Return the bytes of a document; an OSError if it is no file, a ValueError if too large."""
    check_input(path)
    _check_size(path.stat().st_size, most)
    with path.open("rb") as file:
        content = file.read(most + 1)
    _check_size(len(content), most)
    return content


def read_json(
    content: str | bytes, values: int = VALUES, *, most: int = BYTES, shown: bool = True
) -> Any:
    """Read a JSON document; a ValueError if it is damaged or beyond a limit.

    The lengths of texts have a limit only where these may be ``shown``.
    """
    _check_size(len(content), most)
    comma, bracket, brace = (",", "[", "{") if isinstance(content, str) else (b",", b"[", b"{")
    if sum(map(content.count, (comma, bracket, brace))) > 2 * values:  # type: ignore[arg-type]
        raise ValueError(f"it holds more than {values:,} values")
    try:
        found = json.loads(content)
    except (RecursionError, ValueError) as error:
        raise ValueError(_damage(error)) from error
    _check(found, values, shown=shown)
    return found


def _damage(error: Exception) -> str:
    """Return in words what a parser found."""
    match error:
        case RecursionError():
            return _TOO_DEEP
        case json.JSONDecodeError(lineno=line, colno=column):
            return f"it is no JSON, or ends early (line {line}, column {column})"
        case UnicodeDecodeError():
            return "it is not in UTF-8"
        case _ if "integer string conversion" in str(error):
            return "a number in it has thousands of digits"
    return str(error)


def read_toml(text: str) -> dict[str, Any]:
    """Read a TOML document; a ValueError if it is damaged or beyond a limit."""
    _check_size(len(text), TOML_BYTES)
    if sum(line.count(".") ** 2 for line in text.splitlines()) > DOTS**2:
        raise ValueError(f"a name in it has more than {DOTS:,} parts, or several have so many")
    try:
        found = tomllib.loads(text)
    except (RecursionError, ValueError) as error:
        raise ValueError(_damage(error)) from error
    _check(found, VALUES)
    return found


def read_yaml(path: Path) -> Any:
    """Read a YAML document; a ValueError if it is damaged or beyond a limit, or has aliases."""
    import yaml

    try:
        text = read_bounded(path, YAML_BYTES).decode()
        kinds, depth = ("FlowSequence", "FlowMapping", "BlockSequence", "BlockMapping"), 0
        opening = tuple(getattr(yaml, f"{kind}StartToken") for kind in kinds)
        closing = yaml.FlowSequenceEndToken, yaml.FlowMappingEndToken, yaml.BlockEndToken
        for token in yaml.scan(text):
            if isinstance(token, yaml.AliasToken):
                raise ValueError("it has aliases, as *name: write them out")
            # PyYAML would take a minute for brackets that open and never close.
            depth += isinstance(token, opening) - isinstance(token, closing)
            if depth > DEPTH:
                raise RecursionError
        found = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError("it is damaged") from error
    except (RecursionError, ValueError) as error:
        raise ValueError(_damage(error)) from error
    _check(found, VALUES)
    return found


def check_texts(texts: Iterable[str]) -> None:
    """Raise a ValueError for texts that would take too long to show."""
    together = 0
    for text in (line for each in texts for line in each.split("\n")):
        if len(text) > LONGEST:
            raise ValueError(
                f"it holds a text of {len(text):,} letters, and at most {LONGEST:,} are read"
            )
        together += len(text) if len(text) > LONG else 0
        if together > LONG_TOGETHER:
            raise ValueError(f"its long texts have more than {LONG_TOGETHER:,} letters together")


def _check_size(size: int, most: int) -> None:
    if size > most:
        raise ValueError(f"it has {size:,} bytes, and at most {most:,} are read")


def _check(document: Any, most: int, *, shown: bool = True) -> None:
    """Raise a ValueError for a document that is too deep, too large or too long to be shown."""
    texts: list[str] = []
    level: list[Any] = [document]
    depth = values = 0
    while level:
        depth, values = depth + 1, values + len(level)
        inner: list[Any] = []
        if depth > DEPTH:
            raise ValueError(_TOO_DEEP)
        if values > most:
            raise ValueError(f"it holds more than {most:,} values")
        for each in level:
            if isinstance(each, str):
                texts.append(each)
            elif isinstance(each, dict):
                texts += each
                inner += each.values()
            elif isinstance(each, list):
                inner += each
                if shown and sum(len(e) for e in each if isinstance(e, str)) > LISTED:
                    raise ValueError(f"a list in it has more than {LISTED:,} letters")
        level = inner
    if shown:
        check_texts(texts)


def protobuf_fields(message: memoryview) -> Iterator[tuple[int, Any]]:
    """Yield number and value of each field of a message in Protocol Buffers.

    A value is an integer, or the part of the message that holds it. A ValueError if the message is
    damaged.
    """
    place = 0
    while place < len(message):
        key, place = _varint(message, place)
        number, kind = key >> 3, key & 7
        if kind == 0:
            value, place = _varint(message, place)
            yield number, value
            continue
        if kind == 2:
            size, place = _varint(message, place)
        elif kind in _SIZES:
            size = _SIZES[kind]
        else:
            raise ValueError("a kind of field that is not used")
        if size > len(message) - place:
            raise ValueError("a field that is cut off")
        yield number, message[place : place + size]
        place += size


_SIZES: Final = {1: 8, 5: 4}
"""Bytes of fields of a fixed size, by their kind."""


def _varint(message: memoryview, place: int) -> tuple[int, int]:
    """Return an integer, seven bits a byte, and the place behind it."""
    value = 0
    for index, byte in enumerate(message[place : place + 10]):
        value |= (byte & 0x7F) << (7 * index)
        if byte < 0x80:
            return value, place + index + 1
    raise ValueError("an integer that is cut off")
