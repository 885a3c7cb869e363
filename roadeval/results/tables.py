"""Tables read from CSV and Parquet, checked, and written to Parquet."""

from __future__ import annotations

import gzip
import hashlib
import json
import math
import os
import zlib
from collections.abc import Collection, Container, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final

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
"""Rows that a Parquet file of any size may have; more rows need at least a byte each."""
UNPACKED: Final = 256 << 20
"""Bytes that a compressed file of any size may unpack to; a larger file may unpack to 100 times its
size."""
COLUMNS: Final = 1_000
WORDS: Final = 1_000
"""Greatest number of different names in a column of a drive's table, such as variants or regions.
There may be ten times as many texts, because a class has one for each variant."""
FLEET_FORMAT: Final = {"name": "roadeval-fleet", "version": 3}
"""Format of a fleet's folder and its tables. It is raised if a column changes its meaning. If a
column is added, the next run of the fleet's command makes the tables again."""
AGAIN: Final = "run the fleet's command again"
SIGNED: Final = ("exit_code", "truth", "mean", "low", "high")
"""Columns of counts and rates that may be negative: checksums, differences, signals."""
_ANEW: Final = "make the results again with roadeval replay"


class ResultsError(RoadevalError):
    """Results that cannot be written or read."""


@dataclass(frozen=True)
class TableFacts:
    """The number of rows of a table, and the SHA-256 of its text."""

    rows: int
    sha256: str


def read_table(
    name: str,
    source: Path | str,
    facts: Mapping[str, TableFacts] | None = None,
    camera: str = "",
    masks: Collection[tuple[str, str]] | None = None,
) -> pd.DataFrame:
    """Read a table of a drive bit-exactly, and check that it is complete.

    ``name`` is one of `roadeval.results.schema.TABLES`; ``source`` is a CSV file, which may be
    compressed with gzip, or its text with the header line. A file that does not exist has no rows,
    like an empty text. ``facts`` are the summary's facts of each table, by name: a table
    without facts must be empty. It is None if there is no summary. With ``camera``
    only the rows of that camera are returned, and with ``masks`` only rows of these variants and
    stages; other rows take no memory. Names are categoricals of text, even if they look like
    numbers; rates are float64, all other numbers int64. A `ResultsError` if the table is damaged,
    or does not have these facts.
    """
    import pyarrow as pa

    table = TABLES[name]
    where = source if isinstance(source, Path) else f"the recording's table {name}"
    try:
        if isinstance(source, Path):
            check_input(source)
        file = BytesIO(source.encode()) if isinstance(source, str) else _open_csv(source)
    except FileNotFoundError:
        file = BytesIO()
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise ResultsError(f"{where}: damaged ({error}); {_ANEW}") from error
    except OSError as error:
        raise ResultsError(f"{where}: {error.strerror}") from error
    try:
        with file:
            if facts is not None:
                _check_facts(where, file, facts.get(name))
            lines = file.readlines() if facts is None else []
            if len({*lines}) < len(lines):
                raise ValueError("a row is there twice")
            # The file was read to its end. If the end is its beginning, the file has no header.
            content = file if file.tell() else BytesIO(table.header.encode())
            parsed = _parse_csv(content, table, masks)
            # Arrow frees each column as soon as pandas has it. A column of one chunk would become a
            # view, and nobody can write to a view.
            rows: pd.DataFrame = parsed.to_pandas(
                split_blocks=parsed[0].num_chunks > 1, self_destruct=True
            )
    except ValueError as error:  # errors of Arrow are ValueErrors, too
        reason = str(error).partition("\n")[0]
        raise ResultsError(f"{where}: damaged ({reason}); {_ANEW}") from error
    except OSError as error:
        raise ResultsError(f"{where}: {error.strerror}") from error
    pa.default_memory_pool().release_unused()
    return rows[rows["camera"] == camera] if camera else rows


def _open_csv(path: Path) -> BinaryIO:
    """Open a file; a compressed one is unpacked, unless it would fill the memory."""
    if path.suffix != ".gz":
        return path.open("rb")
    most = UNPACKED + 100 * path.stat().st_size
    with gzip.open(path) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise gzip.BadGzipFile(f"it unpacks to more than {most:,} bytes")
    return BytesIO(content)


def _check_facts(where: Path | str, file: BinaryIO, facts: TableFacts | None) -> None:
    digest, ends = hashlib.sha256(), 0
    for part in iter(partial(file.read, 1 << 20), b""):
        digest.update(part)
        ends += part.count(b"\n")
    rows = max(ends - 1, 0)
    actual = TableFacts(rows, digest.hexdigest())
    if actual == facts or (facts is None and not rows):
        return
    stated_rows = facts.rows if facts else 0
    if rows != stated_rows and isinstance(where, str):
        raise ResultsError(
            f"{where}: it is a part, or several runs in one, as `rerun rrd` splits and merges them "
            f"({rows} of {stated_rows} rows); give the recording as it was made"
        )
    difference = "its content differs" if rows == stated_rows else f"{rows} of {stated_rows} rows"
    raise ResultsError(f"{where}: does not agree with its summary ({difference}); {_ANEW}")


def _parse_csv(
    file: BinaryIO, table: TableSchema, masks: Collection[tuple[str, str]] | None
) -> pa.Table:
    """Parse CSV, and check the rows of these masks, or all; a ValueError tells what is wrong."""
    import pyarrow as pa
    from pyarrow import compute, csv

    words = pa.dictionary(pa.int32(), pa.string())  # each distinct word is held once
    types = [(c.name, words if c.is_word else TYPES[c.kind]) for c in table.columns]
    options = csv.ConvertOptions(column_types=pa.schema(types))
    file.seek(-1, os.SEEK_END)
    has_end = file.read() == b"\n"
    file.seek(0)
    if masks is None:
        parsed = csv.read_csv(file, convert_options=options)
    else:
        is_chosen = compute.scalar(False)
        for variant, stage in masks:
            is_chosen |= (compute.field("variant") == variant) & (compute.field("stage") == stage)
        with csv.open_csv(file, convert_options=options) as blocks:
            chosen = (pa.Table.from_batches([block]).filter(is_chosen) for block in blocks)
            parsed = pa.concat_tables([blocks.schema.empty_table(), *chosen])
    if not has_end:
        raise ValueError("its last line is cut off")
    complete = [c.name for c in table.columns if c.kind not in (Kind.RATE, Kind.NUMBER)]
    parsed = _check_columns(parsed, table.columns, complete).unify_dictionaries()
    for column in (column for column in table.columns if column.is_word):
        names = _words_of(parsed[column.name])
        if len(names) > (WORDS if column.kind is Kind.NAME else 10 * WORDS):
            raise ValueError(f"column {column.name} holds {len(names):,} different words")
        check_texts(names)
        for name in names if column.kind is Kind.NAME else ():
            if not is_plain(name):
                raise ValueError(f"{name[:NAMED]!r} in column {column.name} is not a name")
    return parsed


def _check_columns(rows: pa.Table, columns: Sequence[Column], complete: Container[str]) -> pa.Table:
    """Return rows with the columns of `LATER`; a ValueError for any other defect."""
    import pyarrow as pa
    from pyarrow import compute

    for name in sorted({*LATER} & {column.name for column in columns} - {*rows.column_names}):
        rows = rows.append_column(name, pa.array(np.zeros(len(rows), np.int64)))
    if len({*rows.column_names}) < len(rows.column_names):
        raise ValueError("a column is there twice")
    if missing := [column.name for column in columns if column.name not in rows.column_names]:
        raise ValueError(f"no column {', '.join(missing)}")
    for name, cells, kind in ((c.name, rows[c.name], c.kind) for c in columns):
        expected = pa.type_for_alias(TYPES[kind])
        is_dictionary = pa.types.is_dictionary(cells.type)
        if (cells.type.value_type if is_dictionary else cells.type) != expected:
            raise ValueError(f"column {name} is not of type {expected}")
        if cells.null_count and name in complete:
            raise ValueError(f"column {name} lacks a value")
        least = -math.inf if name in SIGNED else 0
        ends = compute.min_max(cells).as_py() if kind in (Kind.COUNT, Kind.RATE) else {}
        if wrong := [n for n in ends.values() if n is not None and (n < least or math.isinf(n))]:
            raise ValueError(f"column {name} holds {wrong[0]}")
    return rows


def _words_of(cells: pa.ChunkedArray) -> list[str]:
    """Return the words of a column; its chunks share a dictionary."""
    words: list[str] = cells.chunk(0).dictionary.to_pylist() if cells.num_chunks else []
    return words


def write_parquet(tables: Mapping[Path, tuple[str, pd.DataFrame]], made_of: str = "") -> None:
    """Write tables of a fleet; the files get their names when all of them are written.

    ``tables`` has the name and the rows of each file; NaN is not a value. ``made_of`` is the
    SHA-256 of the summary from which they were made. An OSError if one cannot be written.
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
            # Pages have checksums, because Arrow's ZSTD has none. In short tables the statistics,
            # the dictionaries of numbers and Arrow's copy of the schema would take two fifths, so
            # they are left out. Without that copy Arrow does not write the schema's metadata, so it
            # is added to the file's metadata.
            with parquet.ParquetWriter(
                files[-1].partial,
                schema,
                compression="zstd",
                write_page_checksum=True,
                write_statistics=False,
                use_dictionary=[field.name for field in schema if field.type == pa.string()],
                store_schema=False,
            ) as writer:
                writer.write_table(made.cast(schema))
                writer.add_key_value_metadata(about)
        for file in files:
            file.publish()


def made_of(path: Path) -> str:
    """Return the digest of the summary from which a table was made; empty if it cannot be read."""
    from pyarrow import ArrowException, parquet

    try:
        stated: bytes = parquet.read_metadata(path).metadata[b"made_of"]
        return stated.decode()
    except (OSError, KeyError, TypeError, ValueError, ArrowException):
        return ""


def read_parquet(
    paths: Sequence[Path],
    name: str,
    columns: Collection[str] | None = None,
    runs: Sequence[int] | None = None,
    flag: str = "",
) -> pd.DataFrame:
    """Read a table of a fleet's folder from its files, one below the other.

    With ``columns`` only these, and tags, are read and checked; ``drive`` must be one of them.
    ``runs`` has a number for each file, which becomes the column ``run`` of its rows. With ``flag``
    only the rows with this column set are returned. A `ResultsError` if a file is missing or
    damaged, or has not the columns that it must have.
    """
    import pandas as pd
    import pyarrow as pa

    try:
        table = _read_files(paths, TABLES[name], columns, runs, flag)
    except FileNotFoundError as error:
        raise ResultsError(f"{error.filename}: is not there; {AGAIN}") from None
    except (OSError, ValueError, pa.ArrowException) as error:
        for path in paths if len(paths) > 1 else ():
            read_parquet([path], name, columns)  # its error names the damaged file
        reason = str(error).partition("\n")[0]
        raise ResultsError(f"{paths[0]}: damaged ({reason}); {AGAIN}") from error
    has_gaps = any(c.null_count for c in table.columns if c.type == pa.int64())
    types = {pa.int64(): pd.Int64Dtype()} if has_gaps else {}
    rows: pd.DataFrame = table.to_pandas(types_mapper=types.get)
    counts = [n for n in rows if rows[n].dtype == "Int64" and not rows[n].hasnans]
    return rows.astype(dict.fromkeys(counts, np.int64)) if counts else rows


def _read_files(
    paths: Sequence[Path],
    table: TableSchema,
    chosen: Collection[str] | None,
    runs: Sequence[int] | None,
    flag: str,
) -> pa.Table:
    """Read files of a table and check them; a ValueError tells what is wrong with them."""
    import pyarrow as pa
    from pyarrow import parquet

    columns = [c for c in (*table.columns, *table.of_a_fleet) if not chosen or c.name in chosen]
    names = [column.name for column in columns]
    words = [column.name for column in columns if column.is_word]
    parts, of_drives = [], table.name == "drives"
    complete = ("drive", "name", "status") if of_drives else words
    for place, path in enumerate(paths):
        check_input(path)
        metadata = parquet.read_metadata(path)
        _check_size(metadata, path.stat().st_size)
        # The path is read as one file, because Arrow would make a column of a path with "drive=" in
        # it.
        with parquet.ParquetFile(
            path, metadata=metadata, read_dictionary=words, page_checksum_verification=True
        ) as file:
            tags = [n for n in file.schema_arrow.names if of_drives and n.startswith(TAG)]
            part = file.read([*names, *tags] if chosen else None, use_threads=False)
        part = _check_columns(part, columns, complete)
        if of_drives and not len(part):
            raise ValueError("it has no rows")
        if runs:
            part = part.append_column("run", pa.array(np.full(len(part), runs[place])))
        parts.append(part.filter(part[flag]) if flag else part)
    rows = pa.concat_tables(parts or [table.arrow().empty_table()], promote_options="default")
    rows = rows.unify_dictionaries()
    for cells in (rows[word] for word in words if pa.types.is_dictionary(rows[word].type)):
        texts = _words_of(cells)
        if any(len(text) > LONG for text in texts):  # many rows may share a long text
            codes = cells.combine_chunks().indices.drop_null().to_pylist()
            check_texts(texts[code] for code in codes)
    for drive in rows["drive"].unique().to_pylist():  # files have the names of drives
        if not is_plain(drive):
            raise ValueError(f"a drive is called {drive[:NAMED]!r}, which is not a name")
    tags = [name for name in rows.column_names if of_drives and name.startswith(TAG)]
    return rows.select([*names, *tags, *(["run"] if runs else [])])


def _check_size(metadata: parquet.FileMetaData, size: int) -> None:
    """Raise a ValueError for a small file that would fill the memory."""
    groups = (metadata.row_group(place) for place in range(metadata.num_row_groups))
    unpacked = sum(group.total_byte_size for group in groups)
    if metadata.num_rows > ROWS + size or unpacked > UNPACKED + 100 * size:
        raise ValueError(
            f"{size:,} bytes that unpack to {metadata.num_rows:,} rows and {unpacked:,} bytes"
        )
    if metadata.num_columns > COLUMNS:
        raise ValueError(f"{metadata.num_columns:,} columns, and at most {COLUMNS:,} are read")
