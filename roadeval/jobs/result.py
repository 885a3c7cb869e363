"""Results that are opened: of one drive, whole or partial, and of any number of drives."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sized
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import Rows
from roadeval.errors import RoadevalError
from roadeval.evaluation import score
from roadeval.evaluation.score import as_parts, drive_effects
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.recording.layout import DamagedError, RecordingError
from roadeval.results.fleet.folder import Fleet
from roadeval.results.fleet.kind import is_fleet
from roadeval.results.fleet.record import frames_path
from roadeval.results.fleet.tables import read_frames
from roadeval.results.folder import RUN, ResultsFolder
from roadeval.results.rows import Key, as_arrays, cells, drive_row, effect_rows, score_rows
from roadeval.results.schema import TABLES
from roadeval.results.sentences import verdict
from roadeval.results.tables import AGAIN, ResultsError, parquet_rows

if TYPE_CHECKING:
    import numpy.typing as npt
    import pandas as pd

    from roadeval.recording import Recording

NO_NUMBER: Final = ("output", "run", "fleet")
"""Tables of a run's settings that change no number."""


class DriveResult:
    """The result of a replay, from an ``.rrd`` or a results folder.

    Parameters
    ----------
    path
        Either.

    Raises
    ------
    RoadevalError
        If it is neither, or by another program or format.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.recording = None if self.path.is_dir() else _recording(self.path)
        self._tables: ResultsFolder | Recording = self.recording or ResultsFolder(self.path)

    @property
    def complete(self) -> bool:
        """Whether the run reached its end."""
        return self.recording is None or self.recording.complete

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings that a reader should see first."""
        return () if self.complete else (f"{self.path}: a partial recording: the end is missing",)

    @property
    def name(self) -> str:
        """The drive's name."""
        return self.recording.layout.drive if self.recording else self.summary["drive"]["name"]

    @property
    def configuration(self) -> Path | None:
        """The file that holds the run's configuration; None where a run left none."""
        if self.recording is not None:
            return self.path if self.recording.result("run") else None
        path = self.path / RUN
        return path if path.exists() else None

    @cached_property
    def viewable(self) -> Path | None:
        """The recording that the viewer can open: its own, or of a folder that of the same run.

        None where that is not where the run wrote it, or is another drive's by now.
        """
        if self.recording is not None:
            return self.path if self.pictured else None
        written = self.summary.get("run", {}).get("output", {}).get("save")
        path = Path(written or Path("recordings", f"{self.name}.rrd"))
        # A summary from elsewhere may name a share of somebody's server, which Windows would ask.
        if str(path).startswith(("//", "\\\\")) or not path.is_file():
            return None
        try:
            other = DriveResult(path).summary.get("log", {}).get("sha256")
        except RoadevalError:
            return None
        return path if other == self.summary["log"]["sha256"] else None

    @cached_property
    def summary(self) -> dict[str, Any]:
        """As ``summary.json``; of an incomplete run, what its tables give."""
        if not self.complete:
            return self._summary_of_part()
        return self._tables.summary

    @cached_property
    def rows(self) -> Rows:
        """The rows of ``frames.csv``, without pandas."""
        return self.table("frames")

    def table(self, name: str) -> Rows:
        """Return the rows of a table that grew frame by frame, without pandas."""
        rows = self._tables.rows(name)
        return rows.take(np.isin(rows["frame"], self._both)) if self._may_be_cut(rows) else rows

    @cached_property
    def frames(self) -> pd.DataFrame:
        """The rows of ``frames.csv``."""
        return self._whole(self._tables.frames)

    @cached_property
    def regions(self) -> pd.DataFrame:
        """The rows of ``regions.csv``."""
        return self._whole(self._tables.regions)

    @cached_property
    def pictured(self) -> tuple[int, ...]:
        """The frames whose pictures are there; none of a folder.

        A run may have kept few, and a killed one may have written some layers of its last frames
        and not others: those are left out.
        """
        if self.recording is None:
            return ()
        recording, unsure = self.recording, set(self.recording.unsure)
        counted = set(self.rows["frame"].tolist())
        return tuple(
            number
            for number in recording.frame_numbers
            if number not in unsure or recording.is_whole(number, scored=number in counted)
        )

    def layer(self, variant: str, name: str, frame: int) -> npt.NDArray[Any] | None:
        """Return a layer of a variant; None where the run did not keep it."""
        assert self.recording is not None
        try:
            return self.recording.layer(variant, name, frame)
        except DamagedError:
            raise
        except RecordingError:
            return None

    @cached_property
    def windows(self) -> Rows:
        """The rows of ``windows.csv``; none of an incomplete run."""
        return self._tables.rows("windows")

    @cached_property
    def levels(self) -> Rows:
        """The rows of ``probabilities.csv``; none where no variant says how probable road is."""
        return self._tables.rows("probabilities")

    @property
    def properties(self) -> Mapping[str, str | int | float]:
        """The recording's own properties, about its origin; none of a folder."""
        return self.recording.layout.properties if self.recording else {}

    def notes(self, frame: int, variant: str) -> tuple[str, ...]:
        """Return the recording's notes on a frame, without those on other variants."""
        if self.recording is None:
            return ()
        others = {each.name for each in self.recording.variants} - {variant}
        notes = self.recording.notes(frame)
        return tuple(note for note in notes if note.partition(" ")[0] not in others)

    def extra(self, name: str) -> pd.DataFrame:
        """Read a further table that the run counted, as ``oracles``; empty if it did not."""
        return self._tables.table(name)

    def _whole(self, table: pd.DataFrame) -> pd.DataFrame:
        """Keep the rows of frames that stand in both tables; a killed run may have cut one."""
        return table[table["frame"].isin(self._both)] if self._may_be_cut(table) else table

    def _may_be_cut(self, table: Sized) -> bool:
        return not self.complete and len(table) > 0

    @cached_property
    def _both(self) -> list[int]:
        """The frames that stand in the tables of frames and of regions."""
        frames, regions = (self._tables.rows(name)["frame"] for name in ("frames", "regions"))
        both: list[int] = np.intersect1d(frames, regions).tolist()
        return both

    def _summary_of_part(self) -> dict[str, Any]:
        """Make the summary that a killed run did not get to write, of what it had scored."""
        assert self.recording is not None
        layout, settings = self.recording.layout, EvaluationSettings()
        effects = drive_effects(list(score.mask_counts(self.rows)), settings)
        return {
            "drive": {"name": layout.drive, "width": layout.width, "height": layout.height},
            "frames": {
                "with_pictures": len(self.pictured),
                "trained_on": layout.properties.get("training_frames", 0),
                "evaluated": len(self.rows.distinct("frame")),
            },
            "warnings": [],
            "losses": [],
            "run": {},
            "settings": {},
            "versions": {},
            "seconds": {},
            "training": {"source": layout.properties.get("trained_on")},
            "totals": (totals := score.totals(self.rows)),
            "verdict": verdict(totals, effects, settings),
            **as_parts(effects),
        }


# --- Any number of drives -------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A drive's part of results. Its tables are read when they are asked for."""

    drive: str
    """Its identity in the result."""
    name: str
    """Its name for people."""
    digest: str | None
    """The log's SHA-256, None where the result does not know it."""
    scored: bool
    """Whether any frame of it was."""
    asked: Mapping[str, Any]
    """Settings that may change its numbers, by names as ``frames.scale``, where known."""
    rows: Callable[[str], Rows]
    """Returns its rows of a table, without pandas."""
    group: str | None = None
    """What it shares with other drives, as a day or a route."""
    tags: Mapping[str, str] = field(default_factory=dict)


class Result:
    """The results of any number of drives, with one table of each kind for all of them.

    Parameters
    ----------
    paths
        Recordings, results folders and fleets' folders.

    Raises
    ------
    RoadevalError
        If one is none of these, or was made by another program or format.

    Examples
    --------
    >>> import roadeval
    >>> for path in ("out.rrd", "monday"):
    ...     result = roadeval.Result(path)
    ...     final = result.scores.query("final and region == 'all'")
    ...     print(len(result.drives), *sorted(final.groupby("variant").ERR.mean().index))
    1 blind filtered unfiltered
    1 blind filtered unfiltered
    """

    def __init__(self, *paths: str | Path) -> None:
        self.paths: Final = tuple(map(Path, paths))
        self._opened: Final = [
            Fleet(path) if is_fleet(path) else DriveResult(path) for path in self.paths
        ]

    @property
    def name(self) -> str:
        """The drive's or the fleet's name; of several results all of them."""
        return ", ".join(each.name for each in self._opened)

    @property
    def summary(self) -> dict[str, Any]:
        """The content of the first result's ``summary.json`` or ``fleet.json``."""
        return self._opened[0].summary

    @property
    def complete(self) -> bool:
        """Whether every run reached its end."""
        return all(isinstance(each, Fleet) or each.complete for each in self._opened)

    @property
    def recording(self) -> Path | None:
        """The recording, where that was opened alone."""
        (first, *more) = self._opened
        return None if more or isinstance(first, Fleet) or not first.recording else first.path

    @cached_property
    def variants(self) -> list[str]:
        """The variants that were scored, in order."""
        found = (
            (row["variant"] for row in each.summary["rates"])
            if isinstance(each, Fleet)
            else each.rows.distinct("variant")
            for each in self._opened
        )
        return [*dict.fromkeys(chain(*found))]

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The drives."""
        return tuple(
            part
            for each in self._opened
            for part in (_members(each) if isinstance(each, Fleet) else [_alone(each)])
        )

    @cached_property
    def drives(self) -> pd.DataFrame:
        """A row per drive and camera, scored or not."""
        return self._of_drives("drives")

    @cached_property
    def scores(self) -> pd.DataFrame:
        """A row per drive, camera, variant, stage and region."""
        return self._of_drives("scores")

    @cached_property
    def effects(self) -> pd.DataFrame:
        """A row per drive, camera, difference between two masks, and rate."""
        return self._of_drives("effects")

    @cached_property
    def frames(self) -> pd.DataFrame:
        """A row per evaluated frame, variant and stage of every drive."""
        return _together(
            each.frames if isinstance(each, DriveResult) else each.frames(member["drive"])
            for each in self._opened
            for member in (each.summary["drives"] if isinstance(each, Fleet) else [{}])
        )

    def _of_drives(self, name: str) -> pd.DataFrame:
        return _together(
            getattr(each, name) if isinstance(each, Fleet) else _own(each, name)
            for each in self._opened
        )


def _together(tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    import pandas as pd

    return pd.concat([*tables], ignore_index=True)


def _own(result: DriveResult, name: str) -> pd.DataFrame:
    """Return a table of drives of a single drive, by what makes a fleet's."""
    import pandas as pd

    facts = result.summary
    key = Key(result.name, facts["drive"].get("camera", ""))
    if name == "drives":
        rows = [drive_row(facts, result.name, str(result.path))]
    elif name == "scores":
        rows = [*score_rows(facts, score.region_totals(result.table("regions")))]
    else:
        rows = [*effect_rows(facts)]
    return pd.DataFrame(cells(name, key, rows), columns=TABLES[name].names)


def _alone(result: DriveResult) -> Part:
    digest = result.summary.get("log", {}).get("sha256")
    return Part(
        *(result.name, result.name, str(digest) if digest else None),
        *(len(result.rows) > 0, asked(result.summary), cache(result.table)),
    )


def _members(fleet: Fleet) -> Iterator[Part]:
    columns = ["drive", "sha256", "evaluated"]
    about = {row["drive"]: row for row in fleet.table("drives", columns).to_pylist()}
    members = fleet.summary["drives"]
    counted = Counter(member["name"] for member in members)
    settings = asked(fleet.summary)
    for member in members:
        drive, row = member["drive"], about[member["drive"]]
        yield Part(
            drive=drive,
            # Two drives of a fleet may have one name.
            name=member["name" if counted[member["name"]] == 1 else "drive"],
            digest=row["sha256"] or None,
            scored=bool(row["evaluated"]),
            asked=settings,
            rows=partial(_rows_of_member, fleet, drive),
            group=member["group"],
            tags=member["tags"],
        )


def _rows_of_member(fleet: Fleet, drive: str, table: str) -> Rows:
    """Return the rows of a fleet's drive; of its frames alone, for they are in one small file."""
    if table != "frames":
        return as_arrays(table, ())
    try:
        return parquet_rows(read_frames(fleet.path, drive), table)
    except FileNotFoundError:
        path = frames_path(fleet.path, drive)
        raise ResultsError(f"{path}: is not there; {AGAIN}") from None


def asked(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a run that may change its numbers, by names as ``frames.scale``."""
    found: dict[str, Any] = {}
    for table, own in summary.get("run", {}).items():
        if table in NO_NUMBER:
            continue
        nested = own.items() if isinstance(own, dict) else [("", own)]
        found |= {f"{table}.{key}".rstrip("."): value for key, value in nested}
    return found


def _recording(path: Path) -> Recording:
    # Only here: a folder is read without what reads a recording.
    from roadeval.recording import Recording

    return Recording(path)
