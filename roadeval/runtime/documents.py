"""JSON, TOML, YAML and Protocol Buffers from elsewhere, read within limits.

A few kilobytes can hold lists that nest too deep for any program, a name of twenty thousand words,
or a word that takes minutes to typeset.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any, Final

from roadeval.runtime.files import check_input

LONGEST: Final = 12_000
"""Greatest number of letters of a text."""
LONG: Final = 1_000
LONG_TOGETHER: Final = 500_000
"""Greatest number of letters of all texts of more than `LONG` letters together."""
LISTED: Final = 1_000_000
"""Greatest number of letters of the texts of a list."""
VALUES: Final = 2_000_000
DEPTH: Final = 32
"""Greatest number of tables and lists inside one another."""
_TOO_MANY: Final = "it holds more than {:,} values"
_TOO_DEEP: Final = f"it nests more than {DEPTH} tables and lists inside one another"
BYTES: Final = 64 << 20
TOML_BYTES: Final = 1 << 20
YAML_BYTES: Final = 1 << 17
DOTS: Final = 2_000
"""Greatest number of parts of a name in TOML; the time to read it grows with their square."""


def read_bounded(path: Path, most: int = BYTES) -> bytes:
    """Return the bytes of a document; an OSError if it is not a file, a ValueError if too large."""
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

    The limits on the lengths of texts apply only if the texts may be ``shown``.
    """
    _check_size(len(content), most)
    marks = ",[{" if isinstance(content, str) else (b",", b"[", b"{")
    if sum(map(content.count, marks)) > 2 * values:  # type: ignore[arg-type]
        raise ValueError(_TOO_MANY.format(values))
    with explaining():
        document = json.loads(content)
    _check(document, values, shown=shown)
    return document


def read_toml(text: str) -> dict[str, Any]:
    """Read a TOML document; a ValueError if it is damaged or beyond a limit."""
    _check_size(len(text), TOML_BYTES)
    if sum(line.count(".") ** 2 for line in text.splitlines()) > DOTS**2:
        raise ValueError(f"a name in it has more than {DOTS:,} parts, or several have so many")
    with explaining():
        document = tomllib.loads(text)
    _check(document, VALUES)
    return document


def read_yaml(path: Path) -> Any:
    """Read a YAML document; a ValueError if it is damaged or beyond a limit, or has aliases."""
    import yaml

    text, depth = read_bounded(path, YAML_BYTES), 0
    try:
        with explaining():
            for token in yaml.scan(text):
                if isinstance(token, yaml.AliasToken):
                    raise ValueError("it has aliases, as *name: write them out")
                # PyYAML takes a minute for brackets that open and never close.
                kind = type(token).__name__
                depth += kind.endswith(("SequenceStartToken", "MappingStartToken"))
                depth -= kind.endswith("EndToken") and not kind.startswith("Stream")
                if depth > DEPTH:
                    raise RecursionError
            document = yaml.safe_load(text)
    # PyYAML raises any of these for a value that does not fit its tag.
    except (yaml.YAMLError, AttributeError, LookupError) as error:
        raise ValueError("it is damaged") from error
    _check(document, VALUES)
    return document


@contextmanager
def explaining() -> Iterator[None]:
    """Turn the errors of a parser into a ValueError in plain words."""
    try:
        yield
    except RecursionError as error:
        raise ValueError(_TOO_DEEP) from error
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise ValueError(f"it is not JSON, or ends early ({place})") from error
    except UnicodeDecodeError as error:
        raise ValueError("it is not in UTF-8") from error
    except ValueError as error:
        if "integer string conversion" not in str(error):
            raise
        raise ValueError("a number in it has thousands of digits") from error


def check_texts(texts: Iterable[str]) -> None:
    """Raise a ValueError for texts that take too long to show."""
    together = 0
    for text in (line for lines in texts if len(lines) > LONG for line in lines.split("\n")):
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
    """Raise a ValueError for a document that is too deep, too large or too long to show."""
    texts: list[str] = []
    level, depth, values = [document], 0, 0
    while level:
        depth, values = depth + 1, values + len(level)
        if depth > DEPTH:
            raise ValueError(_TOO_DEEP)
        if values > most:
            raise ValueError(_TOO_MANY.format(most))
        texts += [value for value in level if isinstance(value, str)]
        tables = [value for value in level if isinstance(value, dict)]
        lists = [value for value in level if isinstance(value, list)]
        for values_of_list in lists if shown else ():
            if sum(len(value) for value in values_of_list if isinstance(value, str)) > LISTED:
                raise ValueError(f"a list in it has more than {LISTED:,} letters")
        texts += chain(*tables)
        level = [*chain(*(table.values() for table in tables), *lists)]
    if shown:
        check_texts(texts)


def protobuf_fields(message: memoryview) -> Iterator[tuple[int, Any]]:
    """Yield number and value of each field of a message in Protocol Buffers.

    A value is an integer, or a part of the message. A ValueError if the message is damaged.
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
        elif kind in (1, 5):
            size = 8 if kind == 1 else 4
        else:
            raise ValueError("a kind of field that is not used")
        if size > len(message) - place:
            raise ValueError("a field that is cut off")
        yield number, message[place : place + size]
        place += size


def _varint(message: memoryview, place: int) -> tuple[int, int]:
    """Return an integer, seven bits per byte, and the place after it."""
    value = 0
    for index, byte in enumerate(message[place : place + 10]):
        value |= (byte & 0x7F) << (7 * index)
        if byte < 0x80:
            return value, place + index + 1
    raise ValueError("an integer that is cut off")
