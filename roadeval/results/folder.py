"""The results folder: tables and summary as plain files.

A new folder is built beside the earlier one and replaces it in one step, see
`roadeval.runtime.files`.
"""

from __future__ import annotations

import gzip
import hashlib
from collections.abc import Collection, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, Self

from roadeval.results.facts import SUMMARY, Facts
from roadeval.results.schema import OF_A_DRIVE, TABLES, TableSchema
from roadeval.results.tables import ResultsError, TableFacts, read_table
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import Content, NewFolder, writing
from roadeval.runtime.sentence import Sentence

if TYPE_CHECKING:
    import pandas as pd


RUN: Final = "run.toml"
"""The configuration file that repeats the run."""
CSV: Final = ".csv"
PACKED: Final = ".csv.gz"
"""Endings of a table's file: as text, and compressed."""
NAME_BYTES: Final = 255
"""Greatest length of a file's name on common file systems."""


def names_of_results(summary: Path) -> frozenset[str]:
    """Return the names of the files that are results according to a summary, if there is one."""
    listed = None
    with suppress(OSError, ValueError, AttributeError):
        listed = read_json(read_bounded(summary)).get("files")
    names = [str(name) for name in listed] if isinstance(listed, list) else []
    # A summary may list anything: names that no file of the folder can have are left out.
    plain = [name for name in names if Path(name).name == name != ".." and name.isprintable()]
    listed_files = {name for name in plain if len(name.encode()) <= NAME_BYTES}
    tables = (f"{table}{ending}" for table in OF_A_DRIVE for ending in (CSV, PACKED))
    return frozenset(listed_files) | {SUMMARY, RUN, *tables}


CONTENT: Final = Content(SUMMARY, names_of_results)
"""The files of an existing results folder that a new one replaces."""


class ResultsWriter:
    """Writes a results folder while frames arrive; it is a context manager.

    The folder takes its name at the end of the context if `finish` was called. After an exception,
    or without `finish`, it is removed, and earlier results stay. Every method raises a
    `ResultsError` if the folder cannot be written to. If ``packed``, tables are compressed, and
    the summary is one line.
    """

    def __init__(self, folder: Path, *, packed: bool = False) -> None:
        self._new = NewFolder(folder, CONTENT)
        self._packed = packed
        self._open: dict[str, _GrowingTable] = {}
        self._finished = False

    @property
    def folder(self) -> Path:
        """The folder of the files until they are published; figures are written there, too."""
        return self._new.partial

    def __enter__(self) -> Self:
        with self.explain_errors():
            self._new.begin()
            for name in OF_A_DRIVE:
                self._open[name] = _GrowingTable(self.folder, TABLES[name], self._packed)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None and self._finished:
                with self.explain_errors():
                    self._new.publish()
        finally:
            for table in self._open.values():
                with suppress(OSError):  # on a full disk closing fails, too
                    table.file.close()
            self._new.discard()

    def append(self, lines: Mapping[str, str]) -> None:
        """Add lines of CSV to tables, by their names."""
        with self.explain_errors():
            for name, text in lines.items():
                self._open[name].append(text)

    @property
    def tables(self) -> dict[str, TableFacts]:
        """The tables that have rows so far."""
        return {name: table.facts for name, table in self._open.items() if table.rows}

    def finish(self, facts: Facts, run_toml: str) -> Facts:
        """Write ``summary.json`` and ``run.toml``; return the facts with the tables and files.

        A table without rows is left out.
        """
        with self.explain_errors():
            for table in self._open.values():
                table.file.close()
                if not table.rows:
                    table.path.unlink()
            (self.folder / RUN).write_bytes(run_toml.encode())
            names = sorted({SUMMARY, *(path.name for path in self.folder.iterdir())})
            facts = replace(facts, tables=self.tables, files=names)
            (self.folder / SUMMARY).write_bytes(facts.text(packed=self._packed).encode())
        self._finished = True
        return facts

    def explain_errors(self) -> AbstractContextManager[None]:
        """Turn an OSError inside the block into a `ResultsError`."""
        remedy = Sentence("choose another folder with {output.reports}")
        return writing(self._new.path, partial(ResultsError, remedy=remedy))


class _GrowingTable:
    """A table to which lines are appended."""

    def __init__(self, folder: Path, table: TableSchema, packed: bool) -> None:
        self.path = folder / f"{table.name}{PACKED if packed else CSV}"
        # Without the time of writing, equal tables are equal files.
        self.file = gzip.GzipFile(self.path, "wb", 6, mtime=0) if packed else self.path.open("wb")
        self.rows = -1  # the header is not a row
        self._digest = hashlib.sha256()
        self.append(table.header)

    @property
    def facts(self) -> TableFacts:
        """The rows so far, and the SHA-256 of the text."""
        return TableFacts(self.rows, self._digest.hexdigest())

    def append(self, lines: str) -> None:
        """Append whole lines of CSV."""
        self.rows += lines.count("\n")
        content = lines.encode()
        self._digest.update(content)
        self.file.write(content)


class ResultsFolder:
    """Reads a results folder of `ResultsWriter`, or the part of one ``camera`` of a rig.

    A `ResultsError` if it holds no results, or results of another format.
    """

    def __init__(self, folder: Path, camera: str = "") -> None:
        self._folder, self._camera = folder, camera
        self._facts_of_all = Facts.read(folder / SUMMARY)
        self.facts = self._facts_of_all.cameras[camera] if camera else self._facts_of_all

    def table(self, name: str, masks: Collection[tuple[str, str]] | None = None) -> pd.DataFrame:
        """Read a table of `roadeval.results.schema.TABLES` by its name, for some masks or for all.

        A table that was not written is empty. A `ResultsError` if it is damaged, or not the one
        that the summary states.
        """
        packed = f"{name}{PACKED}"
        path = self._folder / (packed if packed in self._facts_of_all.files else f"{name}{CSV}")
        return read_table(name, path, self._facts_of_all.tables, self._camera, masks)
