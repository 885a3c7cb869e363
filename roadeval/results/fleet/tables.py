"""The tables of a fleet as Parquet files, made of the drives' records."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.results.fleet.record import Record, frames_path, record_path
from roadeval.results.fleet.schema import FORMAT, LIGHT, RECORDED, TABLES, TAG
from roadeval.results.reading import ResultsError, arrow_schema
from roadeval.results.schema import TABLES as OF_A_DRIVE
from roadeval.runtime.files import NewFile, replacing

if TYPE_CHECKING:
    import pyarrow as pa
    from pyarrow import parquet

WORST: Final = 50
"""Frames that the table of the worst names."""
BATCH: Final = 50_000
"""Rows of a table that wait in memory."""
COMPRESSION: Final = "zstd"
AGAIN: Final = "run the fleet's command again"


@dataclass(frozen=True, slots=True)
class Member:
    """A drive as the fleet's command names it, whatever its log holds.

    Parameters
    ----------
    drive
        Its name in the fleet.
    name, source, group
        See the columns of ``drives``.
    tags
        Values by the tags' keys.
    asked
        What its record was made for, as the command has seen it; None if it does not matter.
    """

    drive: str
    name: str
    source: str
    group: str | None = None
    tags: Mapping[str, str] = field(default_factory=dict)
    asked: str | None = None


def write_tables(folder: Path, members: Iterable[Member], records: Mapping[str, Record]) -> None:
    """Write every table but that of frames; all are whole before one takes its name.

    Parameters
    ----------
    folder
        Of the fleet.
    members
        The drives in the tables' order.
    records
        By the drive; looked up one at a time, so that they may be read as they are needed.

    Raises
    ------
    OSError
        If one cannot be written.
    """
    members = list(members)
    tags = sorted({key for member in members for key in member.tags})
    with ExitStack() as stack:
        writers = {
            name: stack.enter_context(_Writer(folder, name, tags if name == "drives" else ()))
            for name in RECORDED
        }
        worst: list[list[Any]] = []
        for member in members:
            record = records[member.drive]
            writers["drives"].add([_drive_row(member, record, tags)])
            for name in ("scores", "effects"):
                writers[name].add(record.rows[name])
            worst = _worst([*worst, *map(list, record.rows["worst"])])
        writers["worst"].add(worst)
        for writer in writers.values():
            writer.finish()


def write_frames(
    folder: Path, drive: str, results: Path, lights: Mapping[int, Iterable[Any]]
) -> None:
    """Write the rows of a drive's frames, from its ``frames.csv``, in pieces.

    Parameters
    ----------
    folder
        Of the fleet.
    drive
        Its name there.
    results
        The drive's own results folder.
    lights
        The light of each evaluated frame, in the order of the columns `LIGHT`.

    Raises
    ------
    OSError
        If they cannot be written.
    """
    from pyarrow import csv

    path = frames_path(folder, drive)
    schema = _schema("frames", ())
    convert = csv.ConvertOptions(column_types=arrow_schema(OF_A_DRIVE["frames"]))
    with (
        replacing(path) as partial,
        _written(partial, schema) as writer,
        csv.open_csv(results / "frames.csv", convert_options=convert) as batches,
    ):
        finals: dict[str, str] = {}
        for batch in batches:
            finals = {**_finals(batch), **finals}
            writer.write_table(_with_light(batch, finals, lights, schema))


def read_whole(
    path: Path, name: str, columns: list[str] | None = None, remedy: str = AGAIN
) -> pa.Table:
    """Read a table of a fleet's folder that others may have damaged since.

    Parameters
    ----------
    path
        The file.
    name
        The table's, in `roadeval.results.fleet.schema.TABLES`.
    columns
        Which are needed; all by default.
    remedy
        What the user can do where it is damaged.

    Raises
    ------
    FileNotFoundError
        If it is not there.
    ResultsError
        If it cannot be read, or lacks a column, or one is of another type.
    """
    import pyarrow as pa

    try:
        table = read_parquet(path, columns)
    except FileNotFoundError:
        raise
    except (OSError, ValueError, pa.ArrowException) as error:
        reason = str(error).partition("\n")[0]
        raise ResultsError(f"{path}: damaged ({reason}); {remedy}") from error
    for column in arrow_schema(TABLES[name]):
        if column.name not in table.column_names:
            if columns is None or column.name in columns:
                raise ResultsError(f"{path}: has no column {column.name}")
        elif table.schema.field(column.name).type != column.type:
            raise ResultsError(
                f"{path}: damaged (column {column.name} is not of type {column.type}); {remedy}"
            )
    return table


def read_frames(folder: Path, drive: str, columns: list[str] | None = None) -> pa.Table:
    """Read the rows of a drive's frames, by its name in the fleet; see `read_whole`."""
    remedy = f"remove {record_path(folder, drive)} and {AGAIN}"
    return read_whole(frames_path(folder, drive), "frames", columns, remedy)


def read_parquet(path: Path, columns: list[str] | None = None) -> pa.Table:
    """Read a table; an OSError or ValueError if it cannot be read."""
    from pyarrow import parquet

    # As one file: of a path with "drive=" in it a column would be made.
    with parquet.ParquetFile(path, page_checksum_verification=True) as file:
        return file.read(columns=columns)


def _written(path: Path, schema: pa.Schema) -> parquet.ParquetWriter:
    """Open a file for a table, whose pages have checksums: Arrow's ZSTD has none."""
    from pyarrow import parquet

    return parquet.ParquetWriter(path, schema, compression=COMPRESSION, write_page_checksum=True)


class _Writer:
    """Writes a table in pieces; to be used as a context.

    Without `finish` nothing takes the table's name.
    """

    def __init__(self, folder: Path, name: str, tags: Iterable[str]) -> None:
        self._schema: Final = _schema(name, tags)
        self._file: Final = NewFile(folder / f"{name}.parquet")
        self._rows: list[Any] = []
        self._writer: parquet.ParquetWriter | None = None
        self._finished = False

    def __enter__(self) -> _Writer:
        self._file.begin()
        self._writer = _written(self._file.partial, self._schema)
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
        """Add rows, each in the order of the columns."""
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
            pa.array(column, kind) for column, kind in zip(columns, self._schema.types, strict=True)
        ]
        self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))
        self._rows = []


def _schema(name: str, tags: Iterable[str]) -> pa.Schema:
    import pyarrow as pa

    schema = arrow_schema(TABLES[name])
    for tag in tags:
        schema = schema.append(pa.field(f"{TAG}{tag}", pa.string()))
    about = {"roadeval": json.dumps(FORMAT), "about": TABLES[name].doc}
    return schema.with_metadata(about)


def _drive_row(member: Member, record: Record, tags: Iterable[str]) -> list[Any]:
    """Return the row of a drive: its record's, with what the fleet says of it."""
    own = dict(zip(TABLES["drives"].names, record.rows["drives"][0], strict=True))
    own |= {"name": member.name, "source": member.source, "group": member.group}
    return [*own.values(), *(member.tags.get(tag) for tag in tags)]


def _worst(rows: list[list[Any]]) -> list[list[Any]]:
    """Keep the worst of some rows, and count them."""
    names = TABLES["worst"].names
    err, drive, frame = (names.index(name) for name in ("ERR", "drive", "frame"))
    ranked = sorted(rows, key=lambda row: (-row[err], row[drive], row[frame]))[:WORST]
    return [[rank, *row[1:]] for rank, row in enumerate(ranked, 1)]


def _finals(batch: pa.RecordBatch) -> dict[str, str]:
    """Return each variant's final stage, as a drive's first frame tells."""
    from roadeval.evaluation.differences import final_stages

    masks = zip(batch["variant"].to_pylist(), batch["stage"].to_pylist(), strict=True)
    return final_stages(masks)


def _with_light(
    batch: pa.RecordBatch,
    finals: Mapping[str, str],
    lights: Mapping[int, Iterable[Any]],
    schema: pa.Schema,
) -> pa.Table:
    import pyarrow as pa

    variants, stages = batch["variant"].to_pylist(), batch["stage"].to_pylist()
    own = {name: batch[name] for name in schema.names if name in batch.schema.names}
    own["final"] = pa.array(
        [finals.get(v) == s for v, s in zip(variants, stages, strict=True)], pa.bool_()
    )
    light = zip(*(lights[frame] for frame in batch["frame"].to_pylist()), strict=True)
    own |= dict(zip((column.name for column in LIGHT), _arrays(light), strict=True))
    return pa.Table.from_arrays([own[name] for name in schema.names], schema=schema)


def _arrays(columns: Iterable[tuple[Any, ...]]) -> Iterator[pa.Array]:
    import pyarrow as pa

    for column in columns:
        yield pa.array(column, pa.float64(), from_pandas=True)  # NaN is no value
