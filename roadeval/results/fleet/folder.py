"""A fleet's folder: written by its command, read by everything that takes a fleet."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import is_plain
from roadeval.evaluation.conditions import Condition
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.fleet.conditions import DriveJudgement, judge_drives
from roadeval.results.fleet.kind import FILES, FLEET, JUNIT, METRICS, RUN, is_fleet
from roadeval.results.fleet.metrics import flat_metrics, junit_xml
from roadeval.results.fleet.record import (
    RECORDS,
    Record,
    read_record,
    recording_path,
    results_path,
)
from roadeval.results.fleet.summary import summarise
from roadeval.results.fleet.tables import Member, read_frames, write_tables
from roadeval.results.schema import TABLES
from roadeval.results.summary import ALTERED, digest_of, is_as_written, json_text, plain
from roadeval.results.tables import AGAIN, FLEET_FORMAT, ResultsError, read_parquet
from roadeval.runtime.claims import alone
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import check_folder, leads_outside, put
from roadeval.runtime.text import is_utf8

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

RESULTS: Final = (
    *("verdict", "counts", "frames", "rates", "effects", "strata", "conditions", "warnings"),
)
"""Parts of ``fleet.json`` that tell what came out, of which ``digest`` holds a checksum."""
_ROWS: Final = ("drives", "rates", "effects", "strata", "conditions")
"""Its parts that are lists of mappings."""


class FleetWriter:
    """Writes the folder of a fleet.

    Parameters
    ----------
    folder
        Its name.
    """

    def __init__(self, folder: Path) -> None:
        self.folder: Final = Path(folder).absolute()

    def begin(self) -> None:
        """Make the folder, or see that it is a fleet's of this version.

        Raises
        ------
        ResultsError
            If it is something else, or cannot be written to.
        """
        if not is_utf8(str(self.folder)):
            raise ResultsError(
                f"{self.folder}: its bytes are not UTF-8, and Parquet files cannot be written "
                "there: choose another name"
            )
        with self._explained():
            check_folder(self.folder)
            if is_fleet(self.folder):
                with suppress(ValueError):  # damage: it is written anew
                    _check_format(path := self.folder / FLEET, read_json(read_bounded(path)))
            elif not (self.folder / RECORDS).is_dir() and _has_files(self.folder):
                raise ResultsError(
                    f"{self.folder}: holds other files and is no fleet's folder; name a new one"
                )
            (self.folder / RECORDS).mkdir(parents=True, exist_ok=True)
            self._check_links()

    def _check_links(self) -> None:
        """Refuse a folder that would be written elsewhere: it may come from anybody."""
        for each in self.folder.iterdir():
            if leads_outside(each, self.folder):
                raise ResultsError(f"{each}: a link leads out of the fleet's folder; remove it")

    def finish(
        self,
        members: Sequence[Member],
        settings: EvaluationSettings,
        run: Mapping[str, Any],
        run_toml: str,
        conditions: Sequence[Condition] = (),
    ) -> dict[str, Any]:
        """Write the tables of all drives and what follows from them; return ``fleet.json``.

        Parameters
        ----------
        members
            The drives in the tables' order; each has its record.
        settings
            The confidence of intervals, and what is negligible.
        run, run_toml
            The configuration of the fleet, as plain data and as the text of a TOML file.
        conditions
            Judged on each drive, see `roadeval.results.fleet.conditions`.
        """
        # Two commands may replay drives of one folder together.
        with self._explained(), alone(*(self.folder / name for name in FILES)):
            asked = {member.drive: member.asked for member in members}
            write_tables(self.folder, members, _Records(self.folder, asked))
            judgements = [*judge_drives(self.folder, conditions, settings.least_frames)]
            summary = {
                "format": FLEET_FORMAT,
                **summarise(self.folder, members, settings),
                "conditions": [_condition(each, judgements) for each in conditions],
                "run": run,
            }
            summary["digest"] = digest_of(summary, RESULTS)
            put(self.folder / RUN, run_toml.encode())
            metrics = json_text(plain(flat_metrics(summary)))
            put(self.folder / METRICS, metrics.encode())
            put(self.folder / JUNIT, junit_xml(self.folder.name, self._drives(), judgements))
            put(self.folder / FLEET, json_text(plain(summary)).encode())
        return summary

    def _drives(self) -> Iterator[Mapping[str, Any]]:
        columns = ["drive", "name", "status", "reason", "losses", "seconds", "verdict"]
        yield from read_parquet(self.folder / "drives.parquet", "drives", columns).to_pylist()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise ResultsError(
                f"{self.folder}: cannot be written: {error.strerror or error}"
            ) from error


def _condition(condition: Condition, judgements: Sequence[DriveJudgement]) -> dict[str, Any]:
    """Return what ``fleet.json`` holds of a condition: on which drives it holds."""
    own = [each for each in judgements if each.condition == condition.text]
    return {
        "condition": condition.text,
        "judged": sum(each.holds is not None for each in own),
        "not_judged": {each.drive: each.sentence for each in own if each.holds is None},
        "holds": {each.drive: each.sentence for each in own if each.holds},
    }


def _has_files(folder: Path) -> bool:
    return folder.is_dir() and any(folder.iterdir())


class _Records(Mapping[str, Record]):
    """The records of a folder, read as they are needed: all together would fill the memory."""

    def __init__(self, folder: Path, asked: Mapping[str, str | None]) -> None:
        self._folder: Final = folder
        self._asked: Final = asked

    def __getitem__(self, drive: str) -> Record:
        record = read_record(self._folder, drive)
        if record is None:
            raise ResultsError(
                f"{self._folder}: the record of {drive} has gone; run the same command again"
            )
        if self._asked[drive] not in (None, record.asked):
            raise ResultsError(
                f"{self._folder}: another command has replayed {drive} with other settings "
                "meanwhile; run the same command again, or give each a folder of its own"
            )
        return record

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(path.stem for path in (self._folder / RECORDS).glob("*.json")))

    def __len__(self) -> int:
        return sum(1 for _ in self)


class Fleet:
    """The results of a fleet.

    Parameters
    ----------
    folder
        As ``roadeval fleet`` left it; perhaps on another machine, by anybody.
    trust_sources
        Whether logs, masks, models and recordings may be read that lie elsewhere, where the folder
        names them.

    Raises
    ------
    ResultsError
        If it is no fleet's folder, or one of another version, or a table of it cannot be read.

    Examples
    --------
    >>> import roadeval
    >>> fleet = roadeval.Fleet("monday")
    >>> fleet.drives[["name", "status", "evaluated"]].to_dict("records")
    [{'name': 'drive', 'status': 'scored', 'evaluated': 3}]
    >>> final = fleet.scores.query("final and region == 'all'")
    >>> sorted(final.groupby("variant").ERR.mean().index)
    ['blind', 'filtered', 'unfiltered']
    """

    def __init__(self, folder: str | Path, *, trust_sources: bool = False) -> None:
        self.path: Final = Path(folder)
        self.trust_sources: Final = trust_sources
        self.summary: Final[dict[str, Any]] = _read(self.path)

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.path.resolve().name

    def recording(self, drive: str, *, new: bool = False) -> Path:
        """Return where the recording of a drive lies, or where a ``new`` one is to be written.

        A `ResultsError` if a link there leads out of the folder: nothing is written through it, and
        it is read only with `trust_sources`.
        """
        return self._inside(recording_path(self.path, drive), new=new)

    def results(self, drive: str) -> Path:
        """Return where the results folder of a drive lies, as of `recording`."""
        return self._inside(results_path(self.path, drive))

    def _inside(self, path: Path, *, new: bool = False) -> Path:
        if not leads_outside(path, self.path) or (self.trust_sources and not new):
            return path
        what = "nothing is written there; remove it" if new else "`trust_sources` reads it there"
        raise ResultsError(f"{path}: a link leads out of the fleet's folder; {what}")

    @cached_property
    def drives(self) -> pd.DataFrame:
        """A row per drive, scored or not."""
        return self._pandas("drives")

    @cached_property
    def scores(self) -> pd.DataFrame:
        """A row per drive, variant, stage and region."""
        return self._pandas("scores")

    @cached_property
    def effects(self) -> pd.DataFrame:
        """A row per drive, difference between two masks, and rate."""
        return self._pandas("effects")

    @cached_property
    def worst(self) -> pd.DataFrame:
        """A row per frame among the worst of all."""
        return self._pandas("worst")

    def frames(self, drive: str) -> pd.DataFrame:
        """Read the rows of a drive's frames, by its name in the fleet; empty if none was scored."""
        try:
            table = read_frames(self.path, drive)
        except FileNotFoundError:
            table = TABLES["frames"].arrow().empty_table()
        frame: pd.DataFrame = table.to_pandas()
        return frame

    def table(self, name: str, columns: list[str] | None = None) -> pa.Table:
        """Read a table, or some columns of it, as Arrow has them."""
        path = self.path / f"{name}.parquet"
        try:
            return read_parquet(path, name, columns)
        except FileNotFoundError:
            raise ResultsError(f"{path}: is not there; {AGAIN}") from None

    def _pandas(self, name: str) -> pd.DataFrame:
        frame: pd.DataFrame = self.table(name).to_pandas()
        return frame


def _read(folder: Path) -> dict[str, Any]:
    """Read ``fleet.json``; a `ResultsError` if it is not there, damaged or of another format."""
    path = folder / FLEET
    try:
        content = read_json(read_bounded(path))
    except OSError as error:
        raise ResultsError(
            f"{folder}: no fleet here ({FLEET}: {error.strerror}); make one with roadeval fleet"
        ) from error
    except ValueError as error:
        raise ResultsError(f"{path}: damaged ({error}); {AGAIN}") from error
    _check_format(path, content)
    if reason := _damage(content):
        raise ResultsError(f"{path}: damaged ({reason}); {AGAIN}")
    return dict(content)


def _check_format(path: Path, content: Any) -> None:
    form = content.get("format") if isinstance(content, dict) else None
    if form != FLEET_FORMAT:
        raise ResultsError(
            f"{path}: not of format {FLEET_FORMAT['name']} {FLEET_FORMAT['version']}: another "
            "version of roadeval made it; use that one, or another folder"
        )


def _damage(content: Mapping[str, Any]) -> str:
    """Return what is wrong with the content of ``fleet.json``; nothing where it is whole."""
    for part in _ROWS:
        rows = content.get(part)
        if not (isinstance(rows, list) and all(isinstance(row, dict) for row in rows)):
            return f"`{part}` is not what it must be"
    if not all(is_plain(str(row.get("drive"))) for row in content["drives"]):
        return "a drive's name is not made of letters, digits, '-' and '_' alone"
    return "" if is_as_written(content) else ALTERED
