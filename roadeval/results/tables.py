"""Tables read from CSV and Parquet, checked, and written to Parquet."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from roadeval.data import is_plain
from roadeval.errors import RoadevalError
from roadeval.results.schema import LATER, TABLES, TAG, TYPES, Column, Kind, TableSchema
from roadeval.runtime.documents import LONG, check_texts
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
FLEET_FORMAT: Final = {"name": "roadeval-fleet", "version": 3}
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
    name: str, source: Path | str, stated: Mapping[str, TableFacts] | None = None, camera: str = ""
) -> pd.DataFrame:
    """Read a table of a drive bit-exactly, and check that it is whole.

    A `ResultsError` if the table is damaged, or is not the one that the summary states. ``name`` is
    one of `roadeval.results.schema.TABLES`; ``source`` a CSV file, or its text with the header
    line. A file that does not exist has no rows, like an empty text. ``stated`` are the number of
    rows and the SHA-256 that the summary states of each table, by name: one that it does not state
    must be empty. It is None where there is no summary. With ``camera`` only the rows of that
    camera are returned. Names are categoricals of text, even if they look like numbers; rates are
    float64, all other numbers int64.
    """
    table = TABLES[name]
    where = source if isinstance(source, Path) else f"the recording's table {name}"
    try:
        if isinstance(source, Path):
            check_input(source)
        content = source.encode() if isinstance(source, str) else source.read_bytes()
    except FileNotFoundError:
        content = b""
    except OSError as error:
        raise ResultsError(f"{where}: {error.strerror}") from error
    if stated is not None:
        _check(where, content, stated.get(name))
    if not content:
        content = table.header.encode()
    try:
        if stated is None:
            lines = content.splitlines()
            if len({*lines}) < len(lines):
                raise ValueError("a row is there twice")
        rows: pd.DataFrame = _parsed(content, table).to_pandas()
    except ValueError as error:  # Arrow's too
        reason = str(error).partition("\n")[0]
        raise ResultsError(f"{where}: damaged ({reason}); {_ANEW}") from error
    return rows[rows["camera"] == camera] if camera else rows


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


def _parsed(content: bytes, table: TableSchema) -> pa.Table:
    """Parse CSV; a ValueError says what is wrong with it."""
    import pyarrow as pa
    from pyarrow import csv

    words = pa.dictionary(pa.int32(), pa.string())  # each distinct word is held once
    types = [(c.name, words if c.is_word else TYPES[c.kind]) for c in table.columns]
    options = csv.ConvertOptions(column_types=pa.schema(types))
    parsed = csv.read_csv(BytesIO(content), convert_options=options)
    if not content.endswith(b"\n"):
        raise ValueError("its last line is cut off")
    if len({*parsed.column_names}) < len(parsed.column_names):
        raise ValueError("a column is there twice")
    for name in sorted({*table.names} & {*LATER} - {*parsed.column_names}):
        parsed = parsed.append_column(name, pa.array(np.zeros(len(parsed), np.int64)))
    if missing := [name for name in table.names if name not in parsed.column_names]:
        raise ValueError(f"no column {', '.join(missing)}")
    parsed = parsed.unify_dictionaries()
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


def write_parquet(tables: Mapping[Path, tuple[str, pd.DataFrame]], made_of: str = "") -> None:
    """Write tables of a fleet, given by their files; all are whole before one takes its name.

    Of each its name and its rows are given; NaN is no value. ``made_of`` is the SHA-256 of what
    they were made of. An OSError if one cannot be written.
    """
    import pyarrow as pa
    from pyarrow import parquet

    with ExitStack() as stack:
        files = []
        for path, (name, rows) in tables.items():
            schema = TABLES[name].arrow()
            for tag in (name for name in map(str, rows) if name.startswith(TAG)):
                schema = schema.append(pa.field(tag, pa.string()))
            about = {"roadeval": json.dumps(FLEET_FORMAT), "about": TABLES[name].doc}
            about["made_of"] = made_of
            made = pa.Table.from_pandas(rows[schema.names], preserve_index=False)
            files.append(NewFile(path))
            stack.callback(files[-1].discard)
            files[-1].begin()
            # Pages have checksums, for Arrow's ZSTD has none.
            parquet.write_table(
                made.cast(schema).replace_schema_metadata(about),
                files[-1].partial,
                compression="zstd",
                write_page_checksum=True,
            )
        for file in files:
            file.publish()


def made_of(path: Path) -> str:
    """Return of what a table was made, as it was written; empty where it cannot be read."""
    from pyarrow import ArrowException, parquet

    try:
        stated: bytes = parquet.read_metadata(path).metadata[b"made_of"]
        return stated.decode()
    except (OSError, KeyError, TypeError, ValueError, ArrowException):
        return ""


def read_parquet(paths: Sequence[Path], name: str) -> pd.DataFrame:
    """Read a table of a fleet's folder from its files, which others may have damaged.

    A `ResultsError` if one is not there, cannot be read, or lacks a column, or one is of another
    type.
    """
    import pandas as pd
    import pyarrow as pa

    try:
        table = _joined(paths, name)
    except FileNotFoundError as error:
        raise ResultsError(f"{error.filename}: is not there; {AGAIN}") from None
    except (OSError, ValueError, pa.ArrowException) as error:
        for path in paths if len(paths) > 1 else ():
            read_parquet([path], name)  # the damaged one is named
        reason = str(error).partition("\n")[0]
        raise ResultsError(f"{paths[0]}: damaged ({reason}); {AGAIN}") from error
    rows: pd.DataFrame = table.to_pandas(types_mapper={pa.int64(): pd.Int64Dtype()}.get)
    counts = [n for n in rows if rows[n].dtype == "Int64" and not rows[n].hasnans]
    return rows.astype(dict.fromkeys(counts, np.int64))


def _joined(paths: Sequence[Path], name: str) -> pa.Table:
    """Read files of a table one below the other, words as dictionaries, and check them."""
    import pyarrow as pa
    from pyarrow import parquet

    schema, parts = TABLES[name].arrow(), []
    for path in paths:
        check_input(path)
        metadata = parquet.read_metadata(path)
        _check_size(metadata, path.stat().st_size)
        words = [f.name for f in schema if f.type == pa.string()]
        # As one file: of a path with "drive=" in it a column would be made.
        with parquet.ParquetFile(
            path, metadata=metadata, read_dictionary=words, page_checksum_verification=True
        ) as file:
            parts.append(file.read(use_threads=False))
    table = pa.concat_tables(parts or [schema.empty_table()]).unify_dictionaries()
    _check_columns(table, name)
    for word in (word for word in schema.names if pa.types.is_dictionary(table[word].type)):
        for chunk in table[word].chunks[:1]:  # all have the same words
            texts = chunk.dictionary.to_pylist()
            if any(len(text) > LONG for text in texts):  # many rows may have one
                rows = table[word].combine_chunks().indices.drop_null().to_pylist()
                check_texts(texts[row] for row in rows)
    for drive in table["drive"].unique().to_pylist():  # files are called after drives
        if drive is None or not is_plain(drive):
            raise ValueError(f"a drive is called {str(drive)[:NAMED]!r}, which is no name")
    columns = table.column_names if name == "drives" else ()
    tags = [column for column in columns if column.startswith(TAG)]
    return table.select([*schema.names, *tags])


def _check_columns(table: pa.Table, name: str) -> None:
    """Refuse, as a ValueError, a table that lacks a column, or a word, or has another type."""
    import pyarrow as pa

    if len({*table.column_names}) < len(table.column_names):
        raise ValueError("a column is there twice")
    for column in TABLES[name].arrow():
        if column.name not in table.column_names:
            raise ValueError(f"no column {column.name}")
        kind = table.schema.field(column.name).type
        if (kind.value_type if pa.types.is_dictionary(kind) else kind) != column.type:
            raise ValueError(f"column {column.name} is not of type {column.type}")
        needed = name != "drives" or column.name in ("drive", "name", "status")
        if needed and column.type == pa.string() and table[column.name].null_count:
            raise ValueError(f"column {column.name} lacks a value")


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
