"""From logs, folders, globs, URLs and manifests to a list of drives.

A manifest lists drives with their groups, tags and settings. A TOML file has a ``[[drives]]`` for
each::

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
import glob
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from roadeval.config import OF_A_LOG, DriveSettings, RunConfig, read_tables
from roadeval.data import is_plain
from roadeval.errors import RoadevalError
from roadeval.fleet.entry import (
    DriveEntry,
    FleetError,
    cameras_apart,
    counts,
    entry_of,
    file_of,
    identity,
    in_order,
    is_bag,
    is_log,
    is_url,
    last_part,
    scheme_of,
    shown,
)
from roadeval.fleet.remote import drives_below
from roadeval.logs import files_of
from roadeval.runtime.documents import read_toml
from roadeval.runtime.files import check_input
from roadeval.runtime.text import visible

_LONGER: Final = 8
"""Bytes of a digest where shorter ones are equal."""


def find_drives(words: Sequence[str]) -> list[DriveEntry]:
    """Find the drives that some words name, in their order.

    A word is a log (a file of any name), a rosbag2 folder, a folder that is searched through for
    logs and rosbag2 folders, a glob, a URL, or a manifest (``.toml``, ``.csv``). A folder's drives
    come in natural order, without hidden and incomplete files. All files of a rosbag2 folder
    together mean the folder. A drive that is named twice counts once, with what a manifest says of
    it, unless that names two of its cameras. A `RoadevalError` if a word leads to no drive, a
    manifest cannot be used, or a drive is described in two ways.
    """
    found = [entry for word in words for entry in _named(word)]
    if not found:
        raise FleetError("no drive found: name logs, folders of logs, URLs or a manifest")
    entries = _once(_whole_bags(found))
    times = Counter(each.id for each in {entry.source: entry for entry in entries}.values())
    return cameras_apart(
        [
            replace(entry, id=identity(entry.source, _LONGER)) if times[entry.id] > 1 else entry
            for entry in entries
        ]
    )


def _named(word: str) -> Iterator[DriveEntry]:
    try:
        path = Path(word)
        if is_url(word) or not is_manifest(path) or not path.is_file():
            yield from map(entry_of, _sources(word, Path()))
            return
        for entry in read_manifest(path):
            yield from _listed(entry, path.parent)
    except OSError as error:
        raise FleetError(f"{visible(word)}: {error.strerror or error}") from error


def _listed(entry: ManifestEntry, folder: Path) -> Iterator[DriveEntry]:
    """Yield the drives of an entry of a manifest."""
    try:
        sources = _sources(entry.path, folder)
    except RoadevalError as error:
        raise FleetError(f"{entry.where}: {error}") from error
    for source in sources:
        settings = entry.settings and replace(entry.settings, path=source)
        yield entry_of(source, entry.group, entry.tags, settings)


def _sources(word: str, base: Path) -> list[str]:
    """Return the sources of the drives that a word names; a path is relative to a folder."""
    if is_url(word):
        if scheme_of(word) != "file":
            _no_manifest(Path(last_part(word)))
            return drives_below(word) if word.endswith("/") else [word]
        word = str(file_of(word))
    path = base / Path(word).expanduser()
    if path.is_dir():
        found = _below(path) or _none_below(path)
    elif path.exists():
        found = [path]
    elif glob.has_magic(word):
        found = _matches(word, base)
    else:
        raise FleetError(f"{visible(str(path))}: there is no such file or folder")
    return [str(_absolute(each)) for each in map(_no_manifest, found)]


def _no_manifest(path: Path) -> Path:
    if is_manifest(path):
        raise FleetError(f"{visible(str(path))}: a manifest is named by itself, by its path")
    return path


def _below(folder: Path) -> list[Path]:
    """Return the logs and rosbag2 folders in a folder and those below it, in natural order."""
    found: list[Path] = []
    seen: set[Path] = set()
    for name, folders, files in os.walk(folder, onerror=_refuse, followlinks=True):
        here = Path(name)
        if here.resolve() in seen:
            folders.clear()
            continue
        seen.add(here.resolve())
        folders[:] = sorted(filter(counts, folders))
        found += [here] if is_bag(here) else [here / each for each in files if is_log(each)]
    return sorted(found, key=lambda path: in_order(path.relative_to(folder)))


def _none_below(folder: Path) -> list[Path]:
    files_of(folder)  # an error that names what is there, and how to convert it
    raise FleetError(f"{visible(str(folder))}: no log that is complete, here or below")


def _matches(word: str, base: Path) -> list[Path]:
    """Return the drives that a glob matches; ``*`` and ``**`` match only logs."""
    paths = [base / each for each in glob.glob(word, root_dir=base, recursive=True)]  # noqa: PTH207
    files = [path for path in paths if not path.is_dir() and counts(path.name)]
    if Path(word).name in ("*", "**"):
        files = [path for path in files if is_log(path.name)]
    folders = [path for path in paths if path.is_dir()]
    found = {*files, *(drive for folder in folders for drive in _below(folder))}
    if not found:
        raise FleetError(f"{visible(word)}: no log matches it")
    return sorted(found, key=in_order)


def _refuse(error: OSError) -> None:
    raise FleetError(f"{visible(str(error.filename))}: {error.strerror}") from error


def _absolute(path: Path) -> Path:
    """Return the absolute path of a file or folder; a link keeps its own name."""
    return path.resolve() if path.name in ("", "..") else path.parent.resolve() / path.name


def _whole_bags(entries: Sequence[DriveEntry]) -> list[DriveEntry]:
    """Replace the files of a rosbag2 folder by the folder, where all of them, or it, are named.

    Its files would be several drives that share a day, a road and a camera.
    """
    named = {entry.source for entry in entries}
    folders = {path.parent for entry in entries if (path := entry.path) and not path.is_dir()}
    bags = {
        folder
        for folder in folders
        if is_bag(folder)
        and (str(folder) in named or named.issuperset(map(str, folder.glob("*.mcap"))))
    }
    return [_in_bag(entry, bags) for entry in entries]


def _in_bag(entry: DriveEntry, bags: set[Path]) -> DriveEntry:
    if entry.path is None or entry.path.parent not in bags or not is_log(entry.path.name):
        return entry
    folder = str(entry.path.parent)
    settings = entry.settings and replace(entry.settings, path=folder)
    return entry_of(folder, entry.group, entry.tags, settings)


def _once(entries: Iterable[DriveEntry]) -> list[DriveEntry]:
    kept: dict[tuple[str, str], DriveEntry] = {}
    for entry in entries:
        key = entry.source if entry.path is None else os.path.realpath(entry.path), entry.camera
        first = kept.get(key)
        if first is None or first.known == (None, {}, {}):
            kept[key] = entry if first is None or entry.known != first.known else first
        elif entry.known not in (first.known, (None, {}, {})):
            raise FleetError(
                f"{entry.shown}: is named twice, with different groups, tags or settings"
            )
    return list(kept.values())


_KEYS: Final = ("path", "group", "tags", *OF_A_LOG)
_COLUMNS: Final = ("path", "group", "tag.KEY", *(f"{table}.KEY" for table in OF_A_LOG))
_TEXTS: Final = (
    *("topics.image", "topics.truth", "topics.shadow", "topics.masks"),
    *("truth.path", "truth.images"),
)
"""Columns whose cells are text, even if they look like numbers."""
_LISTS: Final = ("labels.road", "labels.ignore")
"""Columns whose cells are numbers, with spaces, commas or semicolons between them, or names."""


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


def is_manifest(path: Path) -> bool:
    """Return whether a file is a manifest, by its name."""
    return path.suffix.lower() in (".toml", ".csv")


def read_manifest(path: Path) -> list[ManifestEntry]:
    """Read the entries of a manifest.

    A `RoadevalError` if it cannot be read, names no drive, or has a key, a tag or a setting that
    cannot be used.
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
    if column in _LISTS and not cell.startswith("["):
        return [name.strip() for name in re.split("[,;]", cell)]
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
