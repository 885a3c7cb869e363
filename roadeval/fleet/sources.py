"""From logs, folders, globs, URLs and manifests to a list of drives."""

from __future__ import annotations

import glob
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.fleet.entry import DriveEntry, counts, entry_of, identity, in_order, is_bag, is_log
from roadeval.fleet.manifest import ManifestEntry, is_manifest, read_manifest
from roadeval.fleet.remote import drives_below
from roadeval.fleet.urls import FleetError, file_of, is_url, last_part, scheme_of
from roadeval.logs import files_of
from roadeval.runtime.text import visible

_LONGER: Final = 8
"""Bytes of a digest where shorter ones are equal."""


def find_drives(words: Sequence[str]) -> list[DriveEntry]:
    """Find the drives that some words name, in their order.

    A word is a log (a file of any name), a rosbag2 folder, a folder that is searched through for
    logs and rosbag2 folders, a glob, a URL, or a manifest (``.toml``, ``.csv``). A folder's drives
    come in natural order, without hidden and incomplete files. All files of a rosbag2 folder
    together mean the folder. A drive that is named twice counts once, with what a manifest says of
    it.

    Raises
    ------
    RoadevalError
        If a word leads to no drive, a manifest cannot be used, or a drive is described in two ways.
    """
    found = [entry for word in words for entry in _named(word)]
    if not found:
        raise FleetError("no drive found: name logs, folders of logs, URLs or a manifest")
    return _told_apart(_once(_whole_bags(found)))


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
    kept: dict[str, DriveEntry] = {}
    for entry in entries:
        key = entry.source if entry.path is None else os.path.realpath(entry.path)
        first = kept.get(key)
        if first is None or first.known == (None, {}, {}):
            kept[key] = entry if first is None or entry.known != first.known else first
        elif entry.known not in (first.known, (None, {}, {})):
            raise FleetError(
                f"{entry.shown}: is named twice, with different groups, tags or settings"
            )
    return list(kept.values())


def _told_apart(entries: Sequence[DriveEntry]) -> list[DriveEntry]:
    """Return drives with different identities; two short digests may be equal by chance."""
    times = Counter(entry.id for entry in entries)
    return [
        replace(entry, id=identity(entry.source, _LONGER)) if times[entry.id] > 1 else entry
        for entry in entries
    ]
