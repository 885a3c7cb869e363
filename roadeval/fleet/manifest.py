"""Manifests: files that list drives, with their groups, tags and settings.

A TOML file has a ``[[drives]]`` for each::

    [[drives]]
    path = "monday/*.mcap"              # relative to the manifest; or a URL
    group = "2026-11-16"
    tags = { weather = "rain", vehicle = 7 }
    labels = { road = [3] }             # and topics, frames: in place of the run's

A CSV file has a row for each, with the columns ``path``, ``group``, ``tag.weather``,
``topics.image``, ``labels.road`` and so on; empty cells are ignored.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from roadeval.config import OF_A_LOG, DriveSettings, RunConfig, read_tables
from roadeval.data import is_plain
from roadeval.fleet.urls import FleetError, shown
from roadeval.runtime.documents import read_toml
from roadeval.runtime.files import check_input

_KEYS: Final = ("path", "group", "tags", *OF_A_LOG)
_COLUMNS: Final = ("path", "group", "tag.KEY", *(f"{table}.KEY" for table in OF_A_LOG))
_TEXTS: Final = ("topics.image", "topics.truth", "topics.shadow", "topics.masks")
"""Columns whose cells are text, even if they look like numbers."""
_LISTS: Final = ("labels.road", "labels.ignore")
"""Columns whose cells are numbers, with spaces, commas or semicolons between them."""


@dataclass(frozen=True, slots=True)
class ManifestEntry:
    """An entry of a manifest."""

    path: str
    """Of one drive or several, as in the file."""
    group: str | None
    tags: Mapping[str, str]
    settings: DriveSettings | None
    """Settings of them alone, in place of those of all drives."""
    where: str
    """Begins a message about the entry."""


def is_manifest(path: Path) -> bool:
    """Return whether a file is a manifest, by its name."""
    return path.suffix.lower() in (".toml", ".csv")


def read_manifest(path: Path) -> list[ManifestEntry]:
    """Read the entries of a manifest.

    Raises
    ------
    RoadevalError
        If it cannot be read, names no drive, or has a key, a tag or a setting that cannot be used.
    """
    rows = list(_rows_of_csv(path) if path.suffix.lower() == ".csv" else _rows_of_toml(path))
    if not rows:
        raise FleetError(f"{path}: names no drive; it needs a [[drives]], or a row, for each")
    base = RunConfig()
    return [_entry(row, where, base) for where, row in rows]


def _rows_of_toml(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    tables = read_tables(path)
    for key in tables:
        if key != "drives":
            raise FleetError(f"{path}: {key}: a manifest has only [[drives]], one for each drive")
    rows = tables.get("drives", [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise FleetError(f"{path}: drives must be tables, each under [[drives]]")
    for number, row in enumerate(rows, 1):
        yield f"{path}: [[drives]] number {number}", row


def _rows_of_csv(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    try:
        check_input(path)
        with path.open(encoding="utf-8-sig", newline="") as file:
            # Spreadsheets write semicolons where the comma is a decimal point.
            header = file.readline()
            file.seek(0)
            delimiter = ";" if ";" in header and "," not in header else ","
            reader = csv.reader(file, delimiter=delimiter, strict=True)
            columns = [name.strip() for name in next(reader, [])]
            _check_columns(columns, path)
            for cells in reader:
                where = f"{path}: line {reader.line_num}"
                if any(cells):
                    yield where, _row(columns, cells, where)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        problem = getattr(error, "strerror", None) or error
        raise FleetError(f"{path}: cannot be read as CSV in UTF-8: {problem}") from error


def _check_columns(columns: Sequence[str], path: Path) -> None:
    for column in columns:
        table, _, key = column.partition(".")
        known = column in ("path", "group") if not key else table in ("tag", *OF_A_LOG)
        if not known:
            raise FleetError(f"{path}: no column can be called {column!r}; {_choose(_COLUMNS)}")
        if columns.count(column) > 1:
            raise FleetError(f"{path}: two columns are called {column!r}")
    if "path" not in columns:
        raise FleetError(f"{path}: no column is called 'path'; {_choose(_COLUMNS)}")


def _row(columns: Sequence[str], cells: Sequence[str], where: str) -> dict[str, Any]:
    if len(cells) != len(columns):
        raise FleetError(f"{where}: {len(cells)} cells below {len(columns)} columns")
    row: dict[str, Any] = {}
    for column, cell in zip(columns, map(str.strip, cells), strict=True):
        if cell:
            *tables, key = ["tags" if part == "tag" else part for part in column.split(".", 2)]
            table = row
            for name in tables:
                table = table.setdefault(name, {})
            table[key] = cell if column.startswith(("tag.", *_TEXTS)) else _value(column, cell)
    return row


def _value(column: str, cell: str) -> Any:
    """Return a cell as in a TOML file: a number, true or false, a list, or else text."""
    if column in _LISTS and re.fullmatch(r"[\d\s,;]+", cell):
        return [int(number) for number in re.findall(r"\d+", cell)]
    if column in ("path", "group"):
        return cell
    try:
        value = read_toml(f"value = {cell}")["value"]
    except ValueError:
        return cell
    return value if isinstance(value, bool | int | float | list) else cell


def _entry(row: Mapping[str, Any], where: str, base: RunConfig) -> ManifestEntry:
    path = row.get("path")
    if not isinstance(path, str) or not path:
        raise FleetError(f"{where}: path must name a log, or several as *.mcap")
    where = f"{where}, {shown(path)}"
    for key in row:
        if key not in _KEYS:
            raise FleetError(f"{where}: {key}: there is no such key; {_choose(_KEYS)}")
    group = _word(row["group"], f"{where}: group") if "group" in row else None
    return ManifestEntry(path, group, _tags(row, where), _settings(row, where, base), where)


def _tags(row: Mapping[str, Any], where: str) -> dict[str, str]:
    tags = row.get("tags", {})
    if not isinstance(tags, Mapping):
        raise FleetError(f'{where}: tags must be a table, as {{ weather = "rain" }}')
    for key in tags:
        if not is_plain(key):
            raise FleetError(
                f"{where}: tag {key!r}: a tag's name is made of letters, digits, '-' and '_' alone"
            )
    return {key: _word(value, f"{where}: tag {key}") for key, value in tags.items()}


def _word(value: Any, where: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if not isinstance(value, str | int | float) or value == "":
        raise FleetError(f"{where}: must be text, a number, true or false")
    return str(value)


def _settings(row: Mapping[str, Any], where: str, base: RunConfig) -> DriveSettings | None:
    tables = {name: row[name] for name in OF_A_LOG if name in row}
    if not tables:
        return None
    settings = DriveSettings(row["path"], tables, where)
    base.with_drives([settings])  # checked before the first drive is replayed
    return settings


def _choose(names: Sequence[str]) -> str:
    return f"choose {', '.join(names)}"
