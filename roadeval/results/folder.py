"""The results folder: tables and summary as plain files that any later version reads.

Tables grow frame by frame under temporary names and take their own only when the run is complete,
``summary.json`` last: where it lies, everything beside it belongs to it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, Final, Self

from roadeval.results.reading import ResultsError, read_table
from roadeval.results.schema import TABLES, TableSchema
from roadeval.results.summary import SUMMARY, read_summary, summary_text
from roadeval.runtime import files

if TYPE_CHECKING:
    import pandas as pd


RUN: Final = "run.toml"
"""The file that makes the run again."""


class ResultsWriter:
    """Writes a results folder while frames arrive; to be used as a context.

    Leaving the context without `finish` removes what was begun and leaves earlier results as they
    were.

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
        self._open: Final[dict[str, _Growing]] = {}
        self._made: Final = [each for each in (folder, *folder.parents) if not each.exists()]
        with self._explained():
            folder.mkdir(parents=True, exist_ok=True)
            for name, table in TABLES.items():
                self._open[name] = _Growing(folder, table)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._discard()

    def append(self, lines: Mapping[str, str]) -> None:
        """Add lines to tables, by their names."""
        with self._explained():
            for name, text in lines.items():
                self._open[name].append(text)

    @property
    def tables(self) -> dict[str, dict[str, Any]]:
        """Rows and SHA-256 of each table that has rows so far, as the summary states them."""
        return {name: table.stated for name, table in self._open.items() if table.rows}

    def finish(self, summary: Mapping[str, Any], run_toml: str) -> list[Path]:
        """Rename all files to their own names, the summary last.

        A table without rows is not there, nor is that of an earlier run: it would not belong to
        this summary.

        Parameters
        ----------
        summary
            See `roadeval.results.summary.summary_text`.
        run_toml
            The configuration of the run, as the text of a TOML file.

        Returns
        -------
        list of Path
            The files written.
        """
        path, text = self._folder / SUMMARY, summary_text({"tables": self.tables} | dict(summary))
        config = self._folder / RUN
        with (
            self._explained(),
            files.replacing(path) as whole,
            files.replacing(config) as configured,
        ):
            configured.write_bytes(run_toml.encode())
            whole.write_bytes(text.encode())
            # From here an earlier run's summary would stand beside this one's tables.
            path.unlink(missing_ok=True)
            written = [table.path for table in self._open.values() if table.complete()]
            self._open.clear()
        return [*written, config, path]

    def _discard(self) -> None:
        for table in self._open.values():
            table.discard()
        self._open.clear()
        for folder in self._made:
            with suppress(OSError):  # one in which something lies by now stays
                folder.rmdir()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._discard()
            raise ResultsError(
                f"{error.filename or self._folder}: cannot write results ({error.strerror}); "
                "choose another folder with `output.reports`"
            ) from error


class _Growing:
    """A table that grows under a temporary name."""

    def __init__(self, folder: Path, table: TableSchema) -> None:
        self.path: Final = folder / f"{table.name}.csv"
        self.rows = 0
        self._temporary: Final = folder / f".{table.name}.csv.partial"
        self._digest: Final = hashlib.sha256()
        self._file: Final[IO[bytes]] = self._temporary.open("wb")
        self._write(table.header)

    @property
    def stated(self) -> dict[str, Any]:
        """As `roadeval.results.reading.fingerprint` of the whole file."""
        return {"rows": self.rows, "sha256": self._digest.hexdigest()}

    def append(self, lines: str) -> None:
        self.rows += lines.count("\n")
        self._write(lines)

    def complete(self) -> bool:
        """Rename the file to its own name and return True; without rows remove it."""
        self._file.close()
        if self.rows:
            self._temporary.replace(self.path)
        else:
            self._temporary.unlink()
            self.path.unlink(missing_ok=True)
        return self.rows > 0

    def discard(self) -> None:
        with suppress(OSError):
            self._file.close()
        self._temporary.unlink(missing_ok=True)

    def _write(self, text: str) -> None:
        content = text.encode()
        self._digest.update(content)
        self._file.write(content)


class ResultsFolder:
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
        self.summary: Final[dict[str, Any]] = read_summary(folder / SUMMARY)

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
        """Read a table by its name in `roadeval.results.schema.TABLES`.

        One that was not written, there being nothing to count, is empty.

        Raises
        ------
        ResultsError
            If it is damaged, or not the one of which the summary tells.
        """
        return read_table(name, self._folder / f"{name}.csv", self.summary)
