"""The tables read back, from a results folder and from a recording alike."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import Rows, is_plain
from roadeval.data.rows import Cells
from roadeval.errors import RoadevalError
from roadeval.results.lines import Row
from roadeval.results.schema import TABLES, Column, Kind, TableSchema
from roadeval.runtime.files import check_input

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

TYPES: Final = {
    Kind.NAME: "string",
    Kind.COUNT: "int64",
    Kind.TIME: "int64",
    Kind.RATE: "float64",
    Kind.TEXT: "string",
    Kind.NUMBER: "float64",
    Kind.FLAG: "bool",
}
"""Each kind's type in Arrow."""
ARRAYS: Final = TYPES | {Kind.NAME: "str", Kind.TEXT: "str"}
"""And in NumPy."""

NAMED: Final = 40
"""Letters of a wrong name that a message quotes."""


class ResultsError(RoadevalError):
    """Results that cannot be written or read."""


def read_table(
    name: str, source: Path | str, summary: Mapping[str, Any] | None = None
) -> pd.DataFrame:
    """Read a table bit-exactly, and check that it is whole.

    Parameters
    ----------
    name
        Of the table, in `roadeval.results.schema.TABLES`.
    source
        A CSV file, or its text with the header line. A file that is not there has no rows, like an
        empty text.
    summary
        The summary that belongs to it. Where it states the table's rows and SHA-256 (its part
        ``tables``, which that of a recording lacks) they must be those of the text.

    Returns
    -------
    DataFrame
        Names are text, whatever they look like; rates are float64, all else int64.

    Raises
    ------
    ResultsError
        If the table is empty, cut off, lacks a column, holds a row twice or a value of another
        type, or is not the one of which the summary tells.
    """
    import pyarrow as pa

    table = _read(name, source, summary)
    fields = (
        each.with_type(pa.string()) if pa.types.is_dictionary(each.type) else each
        for each in table.schema
    )
    return _pandas(table.cast(pa.schema(fields)))


def read_rows(name: str, source: Path | str, summary: Mapping[str, Any] | None = None) -> Rows:
    """Read a table as `read_table` does, without pandas, which takes a third of a second to import.

    Raises
    ------
    ResultsError
        As `read_table`.
    """
    table = _read(name, source, summary)
    return Rows(
        {
            column.name: (_words if column.kind is Kind.NAME else _numbers)(table[column.name])
            for column in TABLES[name].columns
        }
    )


def _read(name: str, source: Path | str, summary: Mapping[str, Any] | None) -> pa.Table:
    """Read a table whose names are dictionaries; a `ResultsError` if it is not whole."""
    import pyarrow as pa

    table = TABLES[name]
    where = source if isinstance(source, Path) else f"the recording's table {name}"
    try:
        content = source.encode() if isinstance(source, str) else _content(source)
    except FileNotFoundError:
        content = b""
    except OSError as error:
        raise ResultsError(f"{where}: {error.strerror}") from error
    stated = None if summary is None else summary.get("tables")
    if stated is not None:
        _check(where, content, stated.get(name))
    if not content:
        # Arrow's own `empty_table` imports pandas.
        return pa.Table.from_batches([], _coded(table))
    try:
        if stated is None:
            _check_lines(content)
        return _parsed(content, table)
    except ValueError as error:  # Arrow's too
        reason = str(error).partition("\n")[0]
        raise ResultsError(
            f"{where}: damaged ({reason}); make the results anew with roadeval replay"
        ) from error


def table_of(name: str, rows: Iterable[Row]) -> pd.DataFrame:
    """Return rows as `read_table` would have read them back."""
    import pyarrow as pa

    schema = arrow_schema(TABLES[name])
    columns = [*zip(*rows, strict=True)] or [()] * len(schema)
    arrays = [pa.array(cells, kind) for cells, kind in zip(columns, schema.types, strict=True)]
    return _pandas(pa.Table.from_arrays(arrays, schema=schema))


def rows_of(name: str, rows: Iterable[Row]) -> Rows:
    """Return rows as `read_rows` would have read them back."""
    columns = TABLES[name].columns
    cells = [*zip(*rows, strict=True)] or [()] * len(columns)
    return Rows(
        {
            column.name: np.array(each, ARRAYS[column.kind])
            for column, each in zip(columns, cells, strict=True)
        }
    )


def fingerprint(content: bytes) -> dict[str, Any]:
    """Return what a summary states of a table: ``rows`` and ``sha256`` of its text."""
    rows = max(content.count(b"\n") - 1, 0)
    return {"rows": rows, "sha256": hashlib.sha256(content).hexdigest()}


def _content(path: Path) -> bytes:
    check_input(path)
    return path.read_bytes()


def _check(where: Path | str, content: bytes, stated: Mapping[str, Any] | None) -> None:
    found = fingerprint(content)
    if found == stated or (stated is None and not found["rows"]):
        return
    wanted = stated["rows"] if stated else 0
    difference = (
        "its content is another" if found["rows"] == wanted else f"{found['rows']} of {wanted} rows"
    )
    raise ResultsError(
        f"{where}: does not agree with its summary ({difference}); "
        "make the results anew with roadeval replay"
    )


def arrow_schema(table: TableSchema) -> pa.Schema:
    """Return a table's columns with their types in Arrow."""
    import pyarrow as pa

    return pa.schema([(column.name, TYPES[column.kind]) for column in table.columns])


def _coded(table: TableSchema) -> pa.Schema:
    """Return the types of a table as it is parsed: of its names each is kept once."""
    import pyarrow as pa

    names = pa.dictionary(pa.int32(), pa.string())
    return pa.schema(
        [(c.name, names if c.kind is Kind.NAME else TYPES[c.kind]) for c in table.columns]
    )


def _words(column: pa.ChunkedArray) -> Cells:
    """Return a column of names as an array of text."""
    chunks = column.unify_dictionaries().chunks
    if not chunks:
        return np.zeros(0, str)
    words = np.array(chunks[0].dictionary.to_pylist(), str)
    # Arrow's own way to NumPy imports pandas.
    places: Cells = np.concatenate([np.from_dlpack(each.indices) for each in chunks])
    return np.asarray(words[places])


def _numbers(column: pa.ChunkedArray) -> Cells:
    """Return a column of numbers as an array; NaN for what is undefined."""
    if not column.chunks:
        return np.zeros(0, column.type.to_pandas_dtype())
    return np.concatenate([_chunk(each) for each in column.chunks])


def _chunk(numbers: pa.Array) -> Cells:
    if not numbers.null_count:
        return np.from_dlpack(numbers)
    here = slice(numbers.offset, numbers.offset + len(numbers))
    known, values = numbers.buffers()
    is_known = np.unpackbits(np.frombuffer(known, np.uint8), bitorder="little")[here]
    return np.where(is_known, np.frombuffer(values, np.float64)[here], np.nan)


def _parsed(content: bytes, table: TableSchema) -> pa.Table:
    """Parse CSV; a ValueError says what is wrong with it."""
    from pyarrow import csv

    options = csv.ConvertOptions(column_types=_coded(table))
    parsed = csv.read_csv(BytesIO(content), convert_options=options)
    if not content.endswith(b"\n"):
        raise ValueError("its last line is cut off")
    if len({*parsed.column_names}) < len(parsed.column_names):
        raise ValueError("a column stands there twice")
    if missing := [name for name in table.names if name not in parsed.column_names]:
        raise ValueError(f"no column {', '.join(missing)}")
    for column in table.columns:
        if column.kind is not Kind.RATE:
            _check_cells(column, parsed[column.name])
    return parsed


def _check_lines(content: bytes) -> None:
    """Refuse, as a ValueError, a table with a line twice: each begins with what it is of."""
    lines = content.splitlines()
    if len({*lines}) < len(lines):
        raise ValueError("a row stands there twice")


def _check_cells(column: Column, cells: pa.ChunkedArray) -> None:
    """Refuse, as a ValueError, a column that lacks a value, or holds what is no name."""
    if cells.null_count:
        raise ValueError(f"column {column.name} lacks a value")
    chunks = cells.chunks if column.kind is Kind.NAME else ()
    for name in (name for chunk in chunks for name in chunk.dictionary.to_pylist()):
        if not is_plain(name):
            raise ValueError(f"column {column.name} holds {name[:NAMED]!r}, which is no name")


def _pandas(table: pa.Table) -> pd.DataFrame:
    frame: pd.DataFrame = table.to_pandas()
    return frame
