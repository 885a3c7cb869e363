"""The tables of a fleet, made of the drives' records."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.results.fleet.record import Record, frames_path, record_path
from roadeval.results.schema import OF_DRIVES, TABLES
from roadeval.results.tables import AGAIN, TableFile, read_parquet

if TYPE_CHECKING:
    import pyarrow as pa

WORST: Final = 50
"""Frames that the table of the worst names."""


@dataclass(frozen=True, slots=True)
class Member:
    """A drive as the fleet's command names it, whatever its log holds."""

    drive: str
    """Its name in the fleet."""
    name: str
    source: str
    group: str | None = None
    """These three: see the columns of ``drives``."""
    tags: Mapping[str, str] = field(default_factory=dict)
    asked: str | None = None
    """Digest of what its record was made for, as the command has seen it; None if any will do."""


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
        files = {
            name: stack.enter_context(
                TableFile(folder / f"{name}.parquet", name, tags if name == "drives" else ())
            )
            for name in OF_DRIVES
        }
        worst: list[list[Any]] = []
        for member in members:
            record = records[member.drive]
            files["drives"].add([_drive_row(member, record, tags)])
            for name in ("scores", "effects"):
                files[name].add(record.rows[name])
            worst = _worst([*worst, *map(list, record.rows["worst"])])
        files["worst"].add(worst)
        for file in files.values():
            file.finish()


def _drive_row(member: Member, record: Record, tags: Iterable[str]) -> list[Any]:
    """Return the row of a drive: its record's, with what the fleet says of it."""
    own = dict(zip(TABLES["drives"].names, record.rows["drives"][0], strict=True))
    own |= {"name": member.name, "source": member.source, "group": member.group}
    return [*own.values(), *(member.tags.get(tag) for tag in tags)]


def _worst(rows: list[list[Any]]) -> list[list[Any]]:
    """Keep the worst of some rows, and rank them."""
    names = TABLES["worst"].names
    err, drive, frame = (names.index(name) for name in ("ERR", "drive", "frame"))
    ranked = sorted(rows, key=lambda row: (-row[err], row[drive], row[frame]))[:WORST]
    return [[rank, *row[1:]] for rank, row in enumerate(ranked, 1)]


def read_frames(folder: Path, drive: str, columns: list[str] | None = None) -> pa.Table:
    """Read the rows of a drive's frames, by its name in the fleet."""
    remedy = f"remove {record_path(folder, drive)} and {AGAIN}"
    return read_parquet(frames_path(folder, drive), "frames", columns, remedy)
