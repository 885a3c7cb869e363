"""A fleet's folder as everything reads it that takes a fleet."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import is_plain
from roadeval.results.fleet.kind import FLEET
from roadeval.results.fleet.record import (
    recording_path,
    results_path,
)
from roadeval.results.fleet.tables import read_frames
from roadeval.results.schema import TABLES
from roadeval.results.summary import ALTERED, is_as_written
from roadeval.results.tables import AGAIN, FLEET_FORMAT, ResultsError, read_parquet
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import leads_outside

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

_ROWS: Final = ("drives", "rates", "effects", "strata", "conditions")
"""Its parts that are lists of mappings."""


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
    check_format(path, content)
    if reason := _damage(content):
        raise ResultsError(f"{path}: damaged ({reason}); {AGAIN}")
    return dict(content)


def check_format(path: Path, content: Any) -> None:
    """Raise a `ResultsError` unless the content is of this version's format."""
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
