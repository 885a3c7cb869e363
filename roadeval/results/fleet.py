"""A fleet's folder: the tables and facts of many drives, and the record of each.

A record is written last. A drive is done if its record is there, was made of the same log,
settings, model and version, and its other files are there.
"""

from __future__ import annotations

import json
import shlex
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import is_plain
from roadeval.evaluation.regions import ALL
from roadeval.evaluation.score import TESTED, by_region
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.facts import (
    FLEET,
    SUMMARY,
    Document,
    FleetFacts,
    Member,
    check_format,
    is_fleet,
)
from roadeval.results.over_drives import summarise
from roadeval.results.schema import FAILED, OF_DRIVES, TABLES
from roadeval.results.tables import (
    AGAIN,
    FLEET_FORMAT,
    ResultsError,
    TableFile,
    parquet_rows,
    read_parquet,
)
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import alone, check_output, leads_outside, put, writing
from roadeval.runtime.text import is_utf8

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

RUN: Final = "run.toml"
FILES: Final = (FLEET, RUN, *(f"{table}.parquet" for table in OF_DRIVES))
"""The files of a fleet's folder; beside them lie folders with files of each drive."""
RECORDS: Final = "records"
RESULTS: Final = "results"
FRAMES: Final = "frames"
PICTURES: Final = "pictures"
RECORDINGS: Final = "recordings"
WORST: Final = 50
"""Frames that the table of the worst names."""

Cells = Sequence[Any]
"""A row's values in the order of its table's columns; None if it is undefined."""


def record_path(folder: Path, drive: str) -> Path:
    """Return the file of a drive's record."""
    return folder / RECORDS / f"{drive}.json"


def frames_path(folder: Path, drive: str) -> Path:
    """Return the table of a drive's frames; its folder's name is no partition's, as ``drive=ID``.

    pandas and Arrow would read that as a second column ``drive``, and refuse the folder.
    """
    return folder / FRAMES / drive / "frames.parquet"


def results_path(folder: Path, drive: str) -> Path:
    """Return the results folder of a drive."""
    return folder / RESULTS / drive


def recording_path(folder: Path, drive: str) -> Path:
    """Return the recording of a drive, which may not have been kept."""
    return folder / RECORDINGS / f"{drive}.rrd"


def inside(path: Path, folder: Path) -> Path:
    """Return a path in a fleet's folder; a `ResultsError` if a link there leads out of it."""
    if leads_outside(path, folder):
        raise ResultsError(f"{path}: a link leads out of the fleet's folder; remove it")
    return path


def is_final(row: Mapping[str, Any]) -> bool:
    """Return whether a row is of a final mask, on all pixels where the table has regions."""
    return bool(row["final"]) and row.get("region", ALL) == ALL


class FleetFolder:
    """Reads a fleet's folder, perhaps made on another machine, by anybody.

    Nothing that lies elsewhere is read or written, where its links and tables lead. A
    `ResultsError` if it is no fleet's folder, or one of another version.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder
        self.facts = FleetFacts.read(folder / FLEET)
        if not all(is_plain(member.drive) for member in self.facts.drives):
            raise ResultsError(
                f"{folder / FLEET}: damaged (a drive's name is not made of letters, digits, '-' "
                f"and '_' alone); {AGAIN}"
            )

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.path.resolve().name

    def recording(self, drive: str) -> Path:
        """Return where the recording of a drive lies, which may not have been kept.

        A `ResultsError` if a link there leads out of the folder.
        """
        return inside(recording_path(self.path, drive), self.path)

    def results(self, drive: str) -> Path:
        """Return where the results folder of a drive lies, as of `recording`."""
        return inside(results_path(self.path, drive), self.path)

    def table(self, name: str) -> pa.Table:
        """Read a table."""
        path = self.path / f"{name}.parquet"
        try:
            return read_parquet(path, name)
        except FileNotFoundError:
            raise ResultsError(f"{path}: is not there; {AGAIN}") from None

    @cached_property
    def drives(self) -> dict[str, dict[str, Any]]:
        """The rows of ``drives`` by the drives' names in the fleet, in the tables' order."""
        return {row["drive"]: row for row in self.table("drives").to_pylist()}

    @cached_property
    def names(self) -> dict[str, str]:
        """The drives' names for people, no two of them equal, by their names in the fleet."""
        times = Counter(row["name"] for row in self.drives.values())
        return {
            drive: row["name"] if times[row["name"]] == 1 else drive
            for drive, row in self.drives.items()
        }

    @property
    def finals(self) -> dict[str, str]:
        """Each scored variant's final stage."""
        return self.facts.finals

    @cached_property
    def first_scores(self) -> dict[str, dict[str, Any]]:
        """By drive the row of ``scores`` of the first variant's final mask, on all pixels."""
        first = next(iter(self.finals), None)
        rows = self._final("scores") if first else []
        return {row["drive"]: row for row in rows if row["variant"] == first}

    def _final(self, name: str) -> list[dict[str, Any]]:
        """Return the rows of the final masks, on all pixels where the table has regions."""
        table = self.table(name)
        table = table.filter(table["final"])
        if "region" in table.column_names:  # in Arrow, for there are many
            from pyarrow import compute

            table = table.filter(compute.equal(table["region"], ALL))
        rows: list[dict[str, Any]] = table.to_pylist()
        return rows

    @cached_property
    def regions(self) -> dict[tuple[str, str], dict[str, float]]:
        """See `roadeval.evaluation.score.by_region`: of all drives together."""
        rows = parquet_rows(self.table("scores"), "scores")
        return by_region(rows.take(rows["final"] & (rows["region"] != ALL)))

    @cached_property
    def effects(self) -> dict[tuple[str, str], list[dict[str, Any]]]:
        """Rows of ``effects`` of the final masks' ERR, where it is known, by base and variant."""
        found: defaultdict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
        for row in self._final("effects"):
            if row["metric"] == TESTED and row["mean"] is not None:
                found[row["base"], row["variant"]].append(row)
        return dict(found)

    @cached_property
    def worst(self) -> list[dict[str, Any]]:
        """The rows of ``worst``: the worst frames over all drives."""
        rows: list[dict[str, Any]] = self.table("worst").to_pylist()
        return rows

    def picture(self, frame: Mapping[str, Any]) -> bytes | None:
        """Return the JPEG of a row of ``worst``; None of one from elsewhere, or that is cut."""
        path = self.path / (frame["picture"] or "")
        if not path.resolve().is_relative_to(self.path.resolve()):
            return None
        with suppress(OSError):
            content = path.read_bytes()
            if content.startswith(b"\xff\xd8\xff") and content.rstrip(b"\0").endswith(b"\xff\xd9"):
                return content
        return None

    def inspect(self, frame: Mapping[str, Any]) -> str:
        """Return the command that opens a row of ``worst`` in the viewer."""
        return shlex.join(["roadeval", "inspect", str(self.path), "--worst", str(frame["rank"])])

    @property
    def height(self) -> int:
        """Height of the frames in pixels; 0 where drives differ."""
        heights = {row["height"] or 0 for row in self.drives.values() if row["evaluated"]}
        return heights.pop() if len(heights) == 1 else 0

    def frames(self, drive: str) -> pa.Table:
        """Read the rows of a drive's frames; a FileNotFoundError if none was scored."""
        remedy = f"remove {record_path(self.path, drive)} and {AGAIN}"
        return read_parquet(frames_path(self.path, drive), "frames", remedy=remedy)

    def all_frames(self) -> Iterator[pd.DataFrame]:
        """Yield the rows of each scored drive's frames."""
        for drive, row in self.drives.items():
            if row["evaluated"]:
                yield self.frames(drive).to_pandas()


@dataclass(frozen=True)
class Record(Document):
    """The record of a drive: its rows in the fleet's tables, and what they were made of."""

    drive: str
    """Its name in the fleet."""
    asked: str
    """Digest of what was asked: settings, model and version."""
    stamp: Mapping[Any, Any] | None
    """Sizes and times of the log's files, which show cheaply whether it has changed; None where
    they could not be read. A file's name may hold bytes that are no text."""
    rows: Mapping[str, Sequence[Cells]] = field(default_factory=dict)
    """Its rows of each table in `roadeval.results.schema.OF_DRIVES`."""

    FORMAT = FLEET_FORMAT
    AGAIN = AGAIN
    RESULTS = ("drive", "asked", "stamp", "rows")

    def table(self, name: str) -> list[dict[str, Any]]:
        """Return its rows of a table."""
        names = TABLES[name].names
        return [dict(zip(names, row, strict=True)) for row in self.rows[name]]

    def value(self, column: str) -> Any:
        """Return a value of the drive's own row in ``drives``."""
        return self.table("drives")[0][column]

    @property
    def failed(self) -> bool:
        """Whether the drive could not be used at all."""
        return bool(self.value("status") == FAILED)

    def is_whole(self, folder: Path) -> bool:
        """Return whether the drive's other files are there, too."""
        if self.failed:
            return True
        needed = [results_path(folder, self.drive) / SUMMARY]
        if self.value("evaluated"):
            needed.append(frames_path(folder, self.drive))
        return all(path.exists() for path in needed)

    @property
    def fits(self) -> bool:
        """Whether the rows have their tables' columns, and the drive its row."""
        widths = all(
            len(row) == len(TABLES[name].names)
            for name in OF_DRIVES
            for row in self.rows.get(name, ())
        )
        return widths and {*OF_DRIVES} == self.rows.keys() and len(self.rows["drives"]) == 1

    def write(self, folder: Path) -> None:
        """Write it into a fleet's folder, whole or not at all; an OSError if that fails."""
        content = json.dumps(self.as_dict(), allow_nan=False)
        put(record_path(folder, self.drive), content.encode())


def read_record(folder: Path, drive: str) -> Record | None:
    """Read the record of a drive; None without one that is whole and of this version."""
    path = record_path(folder, drive)
    try:
        record = Record.parse(read_bounded(path), path)
    except (FileNotFoundError, NotADirectoryError, ValueError, ResultsError):
        return None  # not there, not ours, or not whole: it is made again
    except OSError as error:
        raise ResultsError(f"{path}: {error.strerror}") from error
    return record if record.drive == drive and record.fits else None


class FleetWriter:
    """Writes the folder of a fleet."""

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder).absolute()

    def begin(self) -> None:
        """Make the folder, or see that it is a fleet's of this version.

        A `ResultsError` if it is something else, or cannot be written to.
        """
        if not is_utf8(str(self.folder)):
            raise ResultsError(
                f"{self.folder}: its bytes are not UTF-8, and Parquet files cannot be written "
                "there: choose another name"
            )
        with writing(self.folder, ResultsError):
            check_output(self.folder, folder=True)
            if is_fleet(self.folder):
                with suppress(ValueError):  # damage: it is written again
                    path = self.folder / FLEET
                    check_format(read_json(read_bounded(path)), FLEET_FORMAT, path)
            elif (
                not (self.folder / RECORDS).is_dir()
                and self.folder.is_dir()
                and any(self.folder.iterdir())
            ):
                raise ResultsError(
                    f"{self.folder}: holds other files and is no fleet's folder; name a new one"
                )
            (self.folder / RECORDS).mkdir(parents=True, exist_ok=True)
            for each in self.folder.iterdir():  # the folder may come from anybody
                inside(each, self.folder)

    def finish(
        self,
        members: Sequence[Member],
        settings: EvaluationSettings,
        run: Mapping[str, Any],
        run_toml: str,
        *,
        asked: Mapping[str, str] | None = None,
    ) -> FleetFacts:
        """Write the tables of all drives and the facts that follow from them.

        The members are in the tables' order; each has its record. ``run`` and ``run_toml`` are the
        configuration of the fleet, as plain data and as a text. ``asked`` has the digests of what
        each drive's record must have been made for; anything by default.
        """
        # Two commands may replay drives of one folder together.
        with writing(self.folder, ResultsError), alone(*(self.folder / name for name in FILES)):
            tables = self._write_tables(members, asked or {})
            facts = summarise(tables, members, settings, dict(run))
            put(self.folder / RUN, run_toml.encode())
            put(self.folder / FLEET, facts.text().encode())
        return facts

    def _write_tables(
        self, members: Sequence[Member], asked: Mapping[str, str]
    ) -> dict[str, list[dict[str, Any]]]:
        """Write every table but that of frames; all are whole before one takes its name.

        Records are looked up one at a time: all together would fill the memory. Returned are the
        rows of which the facts are made, see `summarise`.
        """
        tags = sorted({key for member in members for key in member.tags})
        kept: dict[str, list[dict[str, Any]]] = {"drives": [], "scores": [], "effects": []}
        worst: list[dict[str, Any]] = []
        with ExitStack() as stack:
            files = {
                name: stack.enter_context(
                    TableFile(
                        self.folder / f"{name}.parquet", name, tags if name == "drives" else ()
                    )
                )
                for name in OF_DRIVES
            }
            for member in members:
                record = self._record(member.drive, asked)
                (own,) = record.table("drives")
                own |= {"name": member.name, "source": member.source, "group": member.group}
                kept["drives"].append(own)
                files["drives"].add([[*own.values(), *(member.tags.get(tag) for tag in tags)]])
                for name in ("scores", "effects"):
                    files[name].add(record.rows[name])
                    kept[name] += filter(is_final, record.table(name))
                worst += record.table("worst")
                worst.sort(key=lambda row: (-row["ERR"], row["drive"], row["frame"]))
                del worst[WORST:]
            files["worst"].add((row | {"rank": n}).values() for n, row in enumerate(worst, 1))
            for file in files.values():
                file.finish()
        return kept

    def _record(self, drive: str, asked: Mapping[str, str]) -> Record:
        record = read_record(self.folder, drive)
        if record is None:
            raise ResultsError(
                f"{self.folder}: the record of {drive} has gone; run the same command again"
            )
        if asked.get(drive, record.asked) != record.asked:
            raise ResultsError(
                f"{self.folder}: another command has replayed {drive} with other settings "
                "meanwhile; run the same command again, or give each a folder of its own"
            )
        return record
