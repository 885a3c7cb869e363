"""The results folder: tables and summary as plain files that any later version reads.

Tables grow frame by frame under temporary names and take their own only when the run is complete,
``summary.json`` last: where it lies, everything beside it belongs to it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, Final, Self

from roadeval.data import FrameResult
from roadeval.errors import RoadevalError
from roadeval.results import tables
from roadeval.results.agreement import disagreement
from roadeval.results.reading import read_table
from roadeval.runtime import files as folders

if TYPE_CHECKING:
    import pandas as pd

FORMAT: Final = {"name": "roadeval-summary", "version": 2}
SUMMARY: Final = "summary.json"
STREAMED: Final = ("frames", "regions", "oracles")
"""The tables that grow frame by frame."""
SUMS: Final = ("windows", "changes", "heat")
"""The tables that are written at the end."""
PARTS: Final = (
    *("format", "verdict", "drive", "frames", "totals", "beyond", "difference", "oracles"),
    *("windows", "health", "training", "seconds", "warnings", "losses"),
    *("run", "settings", "versions", "log"),
)
"""The parts of the summary, in the file's order."""


class ResultsError(RoadevalError):
    """The results cannot be written or read."""


def summary_text(parts: Mapping[str, Any]) -> str:
    """Write a summary as JSON; undefined numbers become null.

    Raises
    ------
    ValueError
        If a part is unknown or missing (see `PARTS`; ``format`` is added here).
    """
    document = {"format": FORMAT} | dict(parts)
    if document.keys() ^ set(PARTS):
        raise ValueError(f"summary: unknown or missing {sorted(document.keys() ^ set(PARTS))}")
    ordered = {name: _plain(document[name]) for name in PARTS}
    return json.dumps(ordered, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


class ResultsWriter:
    """Writes a results folder while frames arrive; to be used as a context.

    Leaving the context without `finish` removes what was begun, the folder too if it was made for
    it, and leaves earlier results as they were.

    Parameters
    ----------
    folder
        Made if it does not exist.

    Raises
    ------
    ResultsError
        From every method, if the folder cannot be written to.
    """

    def __init__(self, folder: Path) -> None:
        self._folder: Final = folder
        self._filled: Final = {SUMMARY}
        self._open: Final[dict[str, IO[str]]] = {}
        self._made: Final[list[Path]] = []
        with self._explained():
            self._made.extend(folders.make(folder))
            for table in STREAMED:
                self._begin(f"{table}.csv", tables.header(table))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._discard()

    def append(self, result: FrameResult) -> None:
        """Add a frame's finished lines; a frame that was not evaluated has none."""
        with self._explained():
            for table, lines in result.tables.items():
                self._open[f"{table}.csv"].write(lines)
                self._filled.add(f"{table}.csv")

    def finish(self, summary: Mapping[str, Any], sums: Mapping[str, str]) -> list[Path]:
        """Complete the tables and give all files their names.

        Where no frame was scored there are no tables, and those of an earlier run are removed:
        they would not belong to this summary.

        Parameters
        ----------
        summary
            All of `PARTS` but ``format``.
        sums
            The lines of the tables in `SUMS`, by name; one that is missing has none.

        Returns
        -------
        list of Path
            The files written.
        """
        with self._explained():
            for table in SUMS:
                self._begin(f"{table}.csv", tables.header(table) + sums.get(table, ""))
                self._filled.update([f"{table}.csv"] if sums.get(table) else [])
            self._begin(SUMMARY, summary_text(summary))
            # From here to the end an earlier run's summary would stand beside this one's tables.
            (self._folder / SUMMARY).unlink(missing_ok=True)
            return [self._folder / name for name in list(self._open) if self._complete(name)]

    def _begin(self, name: str, text: str) -> None:
        self._open[name] = self._temporary(name).open("w", encoding="utf-8", newline="\n")
        self._open[name].write(text)

    def _complete(self, name: str) -> bool:
        """Give a file its name, or remove it if it is a table with nothing in it."""
        self._open.pop(name).close()
        if name in self._filled:
            self._temporary(name).replace(self._folder / name)
            return True
        self._temporary(name).unlink()
        (self._folder / name).unlink(missing_ok=True)
        return False

    def _discard(self) -> None:
        for name, file in self._open.items():
            with suppress(OSError):
                file.close()
            self._temporary(name).unlink(missing_ok=True)
        self._open.clear()
        folders.remove(self._made)

    def _temporary(self, name: str) -> Path:
        return self._folder / f".{name}.partial"

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._discard()
            raise ResultsError(
                f"{error.filename or self._folder}: cannot write results ({error.strerror}); "
                "choose another folder with --reports"
            ) from error


class Results:
    """Reads a results folder.

    Parameters
    ----------
    folder
        As `ResultsWriter` left it.

    Raises
    ------
    ResultsError
        If it holds no results, or results of another format.
    """

    def __init__(self, folder: Path) -> None:
        self._folder: Final = folder
        self.summary: Final[dict[str, Any]] = _read_summary(folder / SUMMARY)

    @property
    def frames(self) -> pd.DataFrame:
        """``frames.csv``: a row per evaluated frame, variant and stage."""
        return self.table("frames")

    @property
    def windows(self) -> pd.DataFrame:
        """``windows.csv``: a row per window, variant and stage."""
        return self.table("windows")

    @property
    def regions(self) -> pd.DataFrame:
        """``regions.csv``: a row per evaluated frame, variant, stage and region."""
        return self.table("regions")

    def table(self, name: str) -> pd.DataFrame:
        """Read a table by its name in `roadeval.results.tables.COLUMNS`.

        One that was not written, there being nothing to count, is empty.

        Raises
        ------
        RoadevalError
            If it is damaged, or lacks rows of which the summary tells.
        """
        path = self._folder / f"{name}.csv"
        table = read_table(path if path.exists() else "", tables.COLUMNS[name])
        if difference := disagreement(name, table, self.summary):
            raise ResultsError(
                f"{path}: does not agree with {SUMMARY}: it has {difference}; "
                "make the results anew with roadeval replay"
            )
        return table


def _read_summary(path: Path) -> dict[str, Any]:
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ResultsError(
            f"{path.parent}: no results here ({SUMMARY}: {error.strerror}); "
            "make some with roadeval replay"
        ) from error
    except ValueError as error:
        raise ResultsError(f"{path}: not a summary ({error}); make it anew") from error
    if not isinstance(summary, dict) or summary.get("format") != FORMAT:
        raise ResultsError(
            f"{path}: not a summary of format {FORMAT['name']} {FORMAT['version']}; "
            "make it anew with this version of roadeval replay"
        )
    return summary


def _plain(value: Any) -> Any:
    """Turn mappings, sequences, paths and undefined numbers into what JSON has."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
