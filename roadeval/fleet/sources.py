"""From logs, folders, globs, URLs and manifests to a list of drives.

A manifest is a TOML file that lists drives with their groups, tags and settings::

    [[drives]]
    path = "monday/*.mcap"              # relative to the manifest; or a URL
    group = "2026-11-16"
    tags = { weather = "rain", vehicle = 7 }
    labels = { road = [3] }             # and topics, frames: in place of the run's
"""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final

from roadeval.config import OF_A_LOG, in_file, override, read_tables
from roadeval.data import is_plain
from roadeval.errors import RoadevalError
from roadeval.fleet.entry import (
    DriveEntry,
    FleetError,
    cameras_apart,
    counts,
    entry_of,
    in_order,
    is_bag,
    is_log,
    is_url,
    last_part,
    scheme_of,
    shown,
)
from roadeval.logs import LogConfig, files_of
from roadeval.runtime.settings import Checked
from roadeval.runtime.text import visible

MANIFEST: Final = ".toml"
"""The ending of a manifest's name."""


def find_drives(words: Sequence[str]) -> list[DriveEntry]:
    """Find the drives that some words name, in their order.

    A word is a log (a file of any name), a rosbag2 folder, a folder that is searched through for
    logs and rosbag2 folders, a glob, a URL, or a manifest (``.toml``). A folder's drives come in
    natural order, without hidden and incomplete files. A file of a rosbag2 folder means the folder.
    A drive that is named twice counts once, with what a manifest says of it, unless that names two
    of its cameras. A `RoadevalError` if a word leads to no drive, a manifest cannot be used, or a
    drive is described in two ways.
    """
    entries = _once(entry for word in words for entry in _named(word))
    if not entries:
        raise FleetError("no drive found: name logs, folders of logs, URLs or a manifest")
    return cameras_apart(entries)


def _named(word: str) -> Iterator[DriveEntry]:
    try:
        path = Path(word)
        if is_url(word) or path.suffix != MANIFEST or not path.is_file():
            yield from map(entry_of, _sources(word, Path()))
        else:
            yield from read_manifest(path)
    except OSError as error:
        raise FleetError(f"{visible(word)}: {error.strerror or error}") from error


def _sources(word: str, base: Path) -> list[str]:
    """Return the sources of the drives that a word names; a path is relative to a folder."""
    if is_url(word):
        scheme_of(word)
        if word.endswith("/"):
            raise FleetError(f"{shown(word)}: a folder; name its logs, or a manifest of them")
        _no_manifest(Path(last_part(word)))
        return [word]
    path = base / Path(word).expanduser()
    if path.is_dir():
        if not (found := _below(path)):
            files_of(path)  # an error that names what is there, and how to convert it
            raise FleetError(f"{visible(str(path))}: no log that is complete, here or below")
    elif path.exists():
        found = [path]
    elif glob.has_magic(word):
        found = _matches(word, base)
    else:
        raise FleetError(f"{visible(str(path))}: there is no such file or folder")
    return [str(_absolute(each)) for each in map(_no_manifest, found)]


def _no_manifest(path: Path) -> Path:
    if path.suffix == MANIFEST:
        raise FleetError(f"{visible(str(path))}: a manifest is named by itself, by its path")
    return path


def _below(folder: Path) -> list[Path]:
    """Return the logs and rosbag2 folders in a folder and those below it, in natural order."""

    def refuse(error: OSError) -> None:
        raise FleetError(f"{visible(str(error.filename))}: {error.strerror}") from error

    found: list[Path] = []
    seen: set[Path] = set()
    for name, folders, files in os.walk(folder, onerror=refuse, followlinks=True):
        here = Path(name)
        if here.resolve() in seen:
            folders.clear()
            continue
        seen.add(here.resolve())
        folders[:] = sorted(filter(counts, folders))
        found += [here] if is_bag(here) else [here / each for each in files if is_log(each)]
    return sorted(found, key=lambda path: in_order(path.relative_to(folder)))


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


def _absolute(path: Path) -> Path:
    """Return the absolute path of a drive; a link keeps its own name."""
    whole = path.resolve() if path.name in ("", "..") else path.parent.resolve() / path.name
    # The files of a rosbag2 folder would be several drives that share a day, a road and a camera.
    return whole.parent if is_log(whole.name) and is_bag(whole.parent) else whole


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


def _tag(name: Any) -> Any:
    if not is_plain(name):
        raise ValueError("a tag's name is made of letters, digits, '-' and '_' alone")
    return name


def _word(value: Any) -> str:
    if not isinstance(value, str | int | float) or value == "":
        raise ValueError("must be text, a number, true or false")
    return str(value).lower() if isinstance(value, bool) else str(value)


Word = Annotated[str, Checked(_word)]


@dataclass(frozen=True, slots=True)
class Row(LogConfig):
    """An entry of a manifest: one drive or several, and the settings that they have alone."""

    path: str = ""
    group: Word | None = None
    tags: Mapping[Annotated[str, Checked(_tag)], Word] = field(default_factory=dict)


def read_manifest(path: Path) -> Iterator[DriveEntry]:
    """Yield the drives of a manifest.

    A `RoadevalError` if it cannot be read, names no drive, or has a key, a tag or a setting that
    cannot be used.
    """
    tables = read_tables(path)
    rows = tables.get("drives")
    if not isinstance(rows, list) or not rows or len(tables) > 1:
        raise FleetError(f"{path}: a manifest has [[drives]], one for each drive, and nothing else")
    for number, table in enumerate(rows, 1):
        where = f"{path}: [[drives]] number {number}"
        with in_file(where):
            row = override(Row(), table, "drives")
        if not row.path:
            raise FleetError(f"{where}: path must name a log, or several as *.mcap")
        try:
            sources = _sources(row.path, path.parent)
        except RoadevalError as error:
            raise FleetError(f"{where}: {error}") from error
        settings = {name: table[name] for name in OF_A_LOG if name in table}
        for source in sources:
            yield entry_of(source, row.group, row.tags, settings)
