"""Tables read from CSV and Parquet, checked, and written to Parquet."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import Rows, is_plain
from roadeval.data.result import Cells
from roadeval.errors import RoadevalError
from roadeval.results.schema import KEY, LATER, TABLES, TAG, TYPES, Column, Kind, TableSchema
from roadeval.runtime.documents import BYTES, LONG, check_texts
from roadeval.runtime.files import NewFile, check_input

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from pyarrow import parquet

NAMED: Final = 40
"""Letters of a wrong name that a message quotes."""
ROWS: Final = 10_000
"""Rows that a file of any size may have; a larger one has at least a byte for each."""
UNPACKED: Final = 256 << 20
COLUMNS: Final = 1_000
WORDS: Final = 1_000
"""Different words in a column of a drive's table: variants, stages, regions."""
BATCH: Final = 50_000
"""Rows of a table that wait in memory before they are written."""
FLEET_FORMAT: Final = {"name": "roadeval-fleet", "version": 2}
"""Of a fleet's folder and its tables; the version rises where a column changes its meaning."""
AGAIN: Final = "run the fleet's command again"
_ANEW: Final = "make the results again with roadeval replay"


class ResultsError(RoadevalError):
    """Results that cannot be written or read."""


@dataclass(frozen=True)
class TableFacts:
    """The rows of a table, and the SHA-256 of its text."""

    rows: int
    sha256: str


def read_table(
    name: str,
    source: Path | str,
    stated: Mapping[str, TableFacts] | None = None,
    camera: str = "",
) -> pd.DataFrame:
    """Read a table of a drive bit-exactly, and check that it is whole.

    A `ResultsError` if the table is damaged, or is not the one that the summary states. ``name`` is
    one of `roadeval.results.schema.TABLES`; ``source`` a CSV file, or its text with the header
    line. A file that does not exist has no rows, like an empty text. ``stated`` are the number of
    rows and the SHA-256 that the summary states of each table, by name: one that it does not state
    must be empty. It is None where there is no summary. With ``camera`` only the rows of that
    camera are returned. Words are text, even if they look like
    numbers; rates are float64, all other numbers int64.
    """
    import pyarrow as pa

    table = _of_camera(_read(name, source, stated), camera)
    fields = (
        each.with_type(pa.string()) if pa.types.is_dictionary(each.type) else each
        for each in table.schema
    )
    frame: pd.DataFrame = table.cast(pa.schema(fields)).to_pandas()
    return frame


def read_rows(
    name: str,
    source: Path | str,
    stated: Mapping[str, TableFacts] | None = None,
    camera: str = "",
) -> Rows:
    """Read a table as `read_table` does, as arrays without the key, and without pandas.

    pandas takes a third of a second to import.
    """
    table = _of_camera(_read(name, source, stated), camera)
    return _arrays(table, TABLES[name].columns[len(KEY) :])


def _read(name: str, source: Path | str, stated: Mapping[str, TableFacts] | None) -> pa.Table:
    import pyarrow as pa

    table = TABLES[name]
    where = source if isinstance(source, Path) else f"the recording's table {name}"
    try:
        content = source.encode() if isinstance(source, str) else _content(source)
    except FileNotFoundError:
        content = b""
    except OSError as error:
        raise ResultsError(f"{where}: {error.strerror}") from error
    if stated is not None:
        _check(where, content, stated.get(name))
    if not content:
        # Arrow's own `empty_table` imports pandas.
        return pa.Table.from_batches([], _coded(table))
    try:
        if stated is None:
            lines = content.splitlines()
            if len({*lines}) < len(lines):
                raise ValueError("a row is there twice")
        return _parsed(content, table)
    except ValueError as error:  # Arrow's too
        reason = str(error).partition("\n")[0]
        raise ResultsError(f"{where}: damaged ({reason}); {_ANEW}") from error


def _of_camera(table: pa.Table, camera: str) -> pa.Table:
    if not camera:
        return table
    from pyarrow import compute

    return table.filter(compute.equal(table["camera"], camera))


def _content(path: Path) -> bytes:
    check_input(path)
    return path.read_bytes()


def _check(where: Path | str, content: bytes, stated: TableFacts | None) -> None:
    rows = max(content.count(b"\n") - 1, 0)
    found = TableFacts(rows, hashlib.sha256(content).hexdigest())
    if found == stated or (stated is None and not rows):
        return
    wanted = stated.rows if stated else 0
    if rows != wanted and isinstance(where, str):
        raise ResultsError(
            f"{where}: it is a part, or several runs in one, as `rerun rrd` splits and merges them "
            f"({rows} of {wanted} rows); give the recording as it was made"
        )
    difference = "its content differs" if rows == wanted else f"{rows} of {wanted} rows"
    raise ResultsError(f"{where}: does not agree with its summary ({difference}); {_ANEW}")


def _coded(table: TableSchema) -> pa.Schema:
    """Return the types of a table as it is parsed: each distinct word is held once."""
    import pyarrow as pa

    words = pa.dictionary(pa.int32(), pa.string())
    types = ((c.name, words if c.is_word else TYPES[c.kind]) for c in table.columns)
    return pa.schema([*types])


def _parsed(content: bytes, table: TableSchema) -> pa.Table:
    """Parse CSV; a ValueError says what is wrong with it."""
    import pyarrow as pa
    from pyarrow import csv

    options = csv.ConvertOptions(column_types=_coded(table))
    parsed = csv.read_csv(BytesIO(content), convert_options=options)
    if not content.endswith(b"\n"):
        raise ValueError("its last line is cut off")
    if len({*parsed.column_names}) < len(parsed.column_names):
        raise ValueError("a column is there twice")
    for name in sorted({*table.names} & {*LATER} - {*parsed.column_names}):
        parsed = parsed.append_column(name, pa.array(np.zeros(len(parsed), np.int64)))
    if missing := [name for name in table.names if name not in parsed.column_names]:
        raise ValueError(f"no column {', '.join(missing)}")
    for column in table.columns:
        if column.kind not in (Kind.RATE, Kind.NUMBER):
            _check_cells(column, parsed[column.name])
    return parsed


def _check_cells(column: Column, cells: pa.ChunkedArray) -> None:
    """Refuse, as a ValueError, a column that lacks a value, or a name that is none."""
    if cells.null_count:
        raise ValueError(f"column {column.name} lacks a value")
    if not column.is_word:
        return
    words = {word for chunk in cells.chunks for word in chunk.dictionary.to_pylist()}
    if len(words) > WORDS:
        raise ValueError(f"column {column.name} holds {len(words):,} different words")
    check_texts(words)
    for name in words if column.kind is Kind.NAME else ():
        if not is_plain(name):
            raise ValueError(f"column {column.name} holds {name[:NAMED]!r}, which is no name")


def _arrays(table: pa.Table, columns: Iterable[Column]) -> Rows:
    return Rows(
        {
            column.name: (_words if column.is_word else _numbers)(table[column.name])
            for column in columns
        }
    )


def _words(column: pa.ChunkedArray) -> Cells:
    """Return a column of words as an array of text; a missing one is empty."""
    import pyarrow as pa

    if not pa.types.is_dictionary(column.type):
        column = column.dictionary_encode()
    chunks = column.unify_dictionaries().chunks
    if not chunks:
        return np.zeros(0, str)
    # Each word once: a table of an hour has millions of rows.
    words = np.array([*chunks[0].dictionary.to_pylist(), ""], str)
    return np.asarray(words[np.concatenate([_filled(each.indices, -1) for each in chunks])])


def _numbers(column: pa.ChunkedArray) -> Cells:
    """Return a column of numbers as an array; NaN for an undefined one, -1 for a missing count."""
    import pyarrow as pa

    if not column.chunks:
        return np.zeros(0, column.type.to_pandas_dtype())
    if pa.types.is_boolean(column.type):
        return np.array(column.to_pylist(), bool)
    blank = np.nan if pa.types.is_floating(column.type) else -1
    return np.concatenate([_filled(each, blank) for each in column.chunks])


def _filled(cells: pa.Array, blank: float) -> Cells:
    # Filling imports pandas.
    return np.from_dlpack(cells.fill_null(blank) if cells.null_count else cells)


class TableFile:
    """Writes a table of a fleet in pieces; to be used as a context.

    Without `finish` no file takes the table's name.
    """

    def __init__(self, path: Path, name: str, tags: Iterable[str] = ()) -> None:
        import pyarrow as pa

        schema = TABLES[name].arrow()
        for tag in tags:
            schema = schema.append(pa.field(f"{TAG}{tag}", pa.string()))
        about = {"roadeval": json.dumps(FLEET_FORMAT), "about": TABLES[name].doc}
        self._schema = schema.with_metadata(about)
        self._file = NewFile(path)
        self._rows: list[Any] = []
        self._writer: parquet.ParquetWriter | None = None
        self._finished = False

    def __enter__(self) -> TableFile:
        from pyarrow import parquet

        self._file.begin()
        # Pages have checksums, for Arrow's ZSTD has none.
        self._writer = parquet.ParquetWriter(
            self._file.partial, self._schema, compression="zstd", write_page_checksum=True
        )
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        assert self._writer is not None
        try:
            self._writer.close()
            if kind is None and self._finished:
                self._file.publish()
        finally:
            self._file.discard()

    def add(self, rows: Iterable[Any]) -> None:
        """Add rows, each in the order of the columns; NaN is no value."""
        self._rows.extend(rows)
        if len(self._rows) >= BATCH:
            self._flush()

    def finish(self) -> None:
        """Write what waits: the table is whole."""
        self._flush()
        self._finished = True

    def _flush(self) -> None:
        import pyarrow as pa

        assert self._writer is not None
        columns = zip(*self._rows, strict=True) if self._rows else [()] * len(self._schema)
        arrays = [
            pa.array(column, kind, from_pandas=True)
            for column, kind in zip(columns, self._schema.types, strict=True)
        ]
        self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))
        self._rows = []


def read_parquet(path: Path, name: str, remedy: str = AGAIN) -> pa.Table:
    """Read a table of a fleet's folder, which others may have damaged.

    ``remedy`` is what the user can do where it is damaged. A `FileNotFoundError` if it is not
    there. A `ResultsError` if it cannot be read, or lacks a column, or one is of another type.
    """
    import pyarrow as pa
    from pyarrow import parquet

    # As one file: of a path with "drive=" in it a column would be made.
    opened = partial(parquet.ParquetFile, path, page_checksum_verification=True)
    try:
        check_input(path)
        with opened() as file:
            _check_size(file.metadata, path.stat().st_size)
            words = [each.name for each in file.schema_arrow if each.type == pa.string()]
        with opened(read_dictionary=words) as file:
            table = _checked_words(file.read())
        for column in TABLES[name].arrow():
            if column.name not in table.column_names:
                raise ResultsError(f"{path}: has no column {column.name}; {remedy}")
            if table.schema.field(column.name).type != column.type:
                raise ValueError(f"column {column.name} is not of type {column.type}")
        for drive in table["drive"].unique().to_pylist():  # files are called after drives
            if drive is None or not is_plain(drive):
                raise ValueError(f"a drive is called {str(drive)[:NAMED]!r}, which is no name")
    except FileNotFoundError:
        raise
    except (OSError, ValueError, pa.ArrowException) as error:
        reason = str(error).partition("\n")[0]
        raise ResultsError(f"{path}: damaged ({reason}); {remedy}") from error
    return table


def _check_size(metadata: parquet.FileMetaData, size: int) -> None:
    """Refuse, as a ValueError, a small file that would fill the memory."""
    groups = [metadata.row_group(place) for place in range(metadata.num_row_groups)]
    unpacked = sum(each.total_byte_size for each in groups)
    if metadata.num_rows > ROWS + size or unpacked > UNPACKED + 100 * size:
        raise ValueError(
            f"{size:,} bytes that unpack to {metadata.num_rows:,} rows and {unpacked:,} bytes"
        )
    if metadata.num_columns > COLUMNS:
        raise ValueError(f"{metadata.num_columns:,} columns, and at most {COLUMNS:,} are read")


def _checked_words(table: pa.Table) -> pa.Table:
    """Return a table with plain words in place of dictionaries; a ValueError if they are too long.

    Until then a long word that many rows have is in memory once.
    """
    import pyarrow as pa

    for place, field in enumerate(table.schema):
        if not pa.types.is_dictionary(field.type):
            continue
        letters = 0
        for chunk in table.column(place).chunks:
            words = chunk.dictionary.to_pylist()
            counts = np.bincount(_filled(chunk.indices, len(words)), minlength=len(words) + 1)
            times = [*zip(words, counts.tolist(), strict=False)]
            check_texts(word for word, n in times for _ in range(n if len(word) > LONG else 1))
            letters += sum(len(word) * n for word, n in times)
        if letters > BYTES:
            raise ValueError(f"column {field.name} has {letters:,} letters")
        table = table.set_column(place, field.name, table.column(place).cast(pa.string()))
    return table


def parquet_rows(table: pa.Table, name: str) -> Rows:
    """Return a table that was read as arrays, with those of its columns that are there."""
    columns = (*TABLES[name].columns, *TABLES[name].of_a_fleet)
    return _arrays(table, [each for each in columns if each.name in table.column_names])
