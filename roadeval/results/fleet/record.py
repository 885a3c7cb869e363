"""The record of a drive: what the tables of its fleet hold of it, and what it was made of.

It is written last. A drive is done where its record stands, was made of the same log, settings,
model and version, and its other files are there.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from roadeval.results.schema import OF_DRIVES, TABLES
from roadeval.results.summary import SUMMARY, digest_of, is_as_written
from roadeval.results.tables import FLEET_FORMAT, ResultsError
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import put

RECORDS: Final = "records"
RESULTS: Final = "results"
FRAMES: Final = "frames"
PICTURES: Final = "pictures"
RECORDINGS: Final = "recordings"

SCORED: Final = "scored"
DAMAGED: Final = "damaged"
UNSCORED: Final = "unscored"
FAILED: Final = "failed"

_KEPT: Final = ("drive", "asked", "stamp", "rows")
"""Parts of a record's file of which ``digest`` holds a checksum."""

Cells = Sequence[Any]
"""A row's values in the order of its table's columns; None where there is none."""


@dataclass(frozen=True, slots=True)
class Record:
    """The record of a drive in a fleet's folder."""

    drive: str
    """Its name in the fleet."""
    asked: str
    """Digest of what was asked: settings, model and version."""
    stamp: Mapping[str, Any] | None
    """What tells cheaply whether its log has changed, as sizes and times of files; None where it
    could not be looked at.
    """
    rows: Mapping[str, Sequence[Cells]] = field(default_factory=dict)
    """Its rows of each table in `roadeval.results.schema.OF_DRIVES`."""

    def value(self, column: str) -> Any:
        """Return a value of the drive's own row in ``drives``."""
        ((*cells,),) = self.rows["drives"]
        return cells[TABLES["drives"].names.index(column)]

    @property
    def failed(self) -> bool:
        """Whether the drive could not be used at all."""
        return bool(self.value("status") == FAILED)

    def is_whole(self, folder: Path) -> bool:
        """Return whether the drive's other files are there, too."""
        if self.failed:
            return True
        needed = [folder / RESULTS / self.drive / SUMMARY]
        if self.value("evaluated"):
            needed.append(frames_path(folder, self.drive))
        return all(path.exists() for path in needed)

    def write(self, folder: Path) -> None:
        """Write it into a fleet's folder, whole or not at all.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        content = {
            "format": FLEET_FORMAT,
            "drive": self.drive,
            "asked": self.asked,
            "stamp": self.stamp,
            "rows": {name: [_plain(row) for row in rows] for name, rows in self.rows.items()},
        }
        content["digest"] = digest_of(content, _KEPT)
        # All in ASCII: the name of a file may hold bytes that are no text.
        put(record_path(folder, self.drive), json.dumps(content, allow_nan=False).encode())


def read_record(folder: Path, drive: str) -> Record | None:
    """Read the record of a drive; None where there is none, or it is of another version."""
    try:
        content = read_json(read_bounded(record_path(folder, drive)))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise ResultsError(f"{record_path(folder, drive)}: {error.strerror}") from error
    except ValueError:
        return None  # not ours, or not whole: it is made again
    return _of(content, drive)


def _of(content: Any, drive: str) -> Record | None:
    """Check what a record's file holds: a file from elsewhere may hold anything."""
    match content:
        case {
            "format": dict(form),
            "drive": str(name),
            "asked": str(asked),
            "stamp": dict() | None as stamp,
            "rows": dict(rows),
            "digest": {"parts": list(parts)},
        } if (
            form == FLEET_FORMAT
            and name == drive
            and parts == [*_KEPT]
            and is_as_written(content)
            and _fits(rows)
        ):
            return Record(name, asked, stamp, rows)
        case _:
            return None


def _fits(rows: Mapping[str, Any]) -> bool:
    """Return whether the rows have their tables' columns, and the drive its row."""
    widths = all(
        isinstance(rows.get(name), list)
        and all(isinstance(row, list) and len(row) == len(TABLES[name].names) for row in rows[name])
        for name in OF_DRIVES
    )
    return widths and len(rows["drives"]) == 1


def record_path(folder: Path, drive: str) -> Path:
    """Return where the record of a drive stands."""
    return folder / RECORDS / f"{drive}.json"


def frames_path(folder: Path, drive: str) -> Path:
    """Return where the rows of a drive's frames stand."""
    return folder / FRAMES / f"drive={drive}" / "frames.parquet"


def results_path(folder: Path, drive: str) -> Path:
    """Return where the results folder of a drive lies."""
    return folder / RESULTS / drive


def recording_path(folder: Path, drive: str) -> Path:
    """Return where the recording of a drive stands, if it was kept."""
    return folder / RECORDINGS / f"{drive}.rrd"


def _plain(row: Cells) -> list[Any]:
    return [None if isinstance(c, float) and not math.isfinite(c) else c for c in row]
