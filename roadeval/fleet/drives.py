"""The drives of a fleet: from logs, folders, globs, URLs and manifests to a list of them.

A drive has a source (a path or a URL), a name, and perhaps a group, tags and settings of its own. A
manifest is a TOML file that lists drives::

    [[drives]]
    path = "monday/*.mcap"              # relative to the manifest; or a URL
    group = "2026-11-16"
    tags = { weather = "rain", vehicle = 7 }
    labels = { road = [3] }             # and topics, frames: in place of the run's
"""

from __future__ import annotations

import glob
import hashlib
import os
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from hashlib import blake2b
from pathlib import Path, PurePath
from typing import Annotated, Any, Final
from urllib.parse import unquote, urlsplit

from roadeval.config.run import OF_A_LOG, RunConfig
from roadeval.config.tables import in_file, override, read_tables
from roadeval.data import as_plain, is_plain
from roadeval.data.words import short_names
from roadeval.errors import RoadevalError
from roadeval.logs.files import METADATA, files_of, natural
from roadeval.logs.settings import CameraSettings, LogConfig
from roadeval.runtime.files import sha256_of
from roadeval.runtime.settings import Checked
from roadeval.runtime.text import public_url, visible, without_secrets

BUCKETS: Final = ("s3", "gs")
"""Schemes of stores that keep objects in buckets."""
SCHEMES: Final = (*BUCKETS, "https", "http")

_URL: Final = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://")


class FleetError(RoadevalError):
    """Drives that cannot be found or fetched, or a manifest that cannot be used."""


def is_url(source: str) -> bool:
    """Return whether a drive's source is a URL, and no path."""
    return _URL.match(source) is not None


def scheme_of(url: str) -> str:
    """Return the scheme of a URL; a `FleetError` if it is none of `SCHEMES`, or has no host."""
    match = _URL.match(url)
    scheme = match[1].lower() if match else ""
    if scheme not in SCHEMES:
        known = ", ".join(f"{each}://" for each in SCHEMES)
        raise FleetError(f"{shown(url)}: no scheme that is known; choose {known}")
    if scheme in ("https", "http"):
        try:
            has_host = bool(urlsplit(url).hostname)
        except ValueError:
            has_host = False
        if not has_host:
            raise FleetError(f"{shown(url)}: no host in it")
    return scheme


def shown(source: str) -> str:
    """Return a drive's source as it may be shown: a URL without user, password and query.

    >>> shown("https://me:secret@host/a.mcap?X-Amz-Signature=5d1c")
    'https://host/a.mcap'
    """
    return visible(public_url(source) if is_url(source) else without_secrets(source))


def bucket_and_key(url: str) -> tuple[str, str]:
    """Split the URL of an object, or of a folder in a bucket.

    Nothing in the key is encoded: ``%``, ``?`` and ``#`` are letters.
    """
    bucket, _, key = url.partition("://")[2].partition("/")
    if "@" in bucket:
        raise FleetError(f"{shown(url)}: credentials are read from the environment, not from a URL")
    if not bucket:
        raise FleetError(f"{shown(url)}: no bucket in it")
    return bucket, key


def last_part(url: str) -> str:
    """Return the name of the file, folder or bucket that a URL leads to; empty if it has none."""
    if scheme_of(url) in BUCKETS:
        bucket, key = bucket_and_key(url)
        return key.rstrip("/").rpartition("/")[2] or bucket
    name = unquote(urlsplit(url).path.rstrip("/").rpartition("/")[2])
    return name.rpartition("/")[2]


DIGEST: Final = 6
"""Bytes of the digest in an identity."""
LONGEST: Final = 40
"""Letters of a name in an identity, which is part of the names of files and folders."""
HEAD: Final = 4096
"""Bytes of rosbag2's `METADATA` that hold its heading."""
BAG: Final = b"rosbag2_bagfile_information"
OF_THE_SYSTEM: Final = ("lost+found", "System Volume Information")
"""Folders at the top of a disk that cannot be read."""


@dataclass(frozen=True)
class DriveEntry:
    """A drive of a fleet."""

    source: str = field(repr=False)
    """An absolute path, or a URL. It may hold a password or a signature: messages and files get
    `shown` instead."""
    id: str
    """Its identity in the fleet: letters, digits, ``-`` and ``_`` alone."""
    name: str
    """Its name for people, safe to show; several drives may have the same."""
    group: str | None = None
    """The same for drives that share a day or a route; None for a single drive."""
    tags: Mapping[str, str] = field(default_factory=dict)
    """Facts about it, as ``{"weather": "rain"}``."""
    settings: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """Settings of it alone, in place of those of all drives, see `RunConfig.of_drive`."""

    @property
    def path(self) -> Path | None:
        """The path of its file or folder; None for a URL."""
        return None if is_url(self.source) else Path(self.source)

    @property
    def shown(self) -> str:
        """The source without its secrets."""
        return shown(self.source)

    @property
    def camera(self) -> str:
        """The topic of its images, where that is given for it alone."""
        return str(self.settings.get("topics", {}).get("image", ""))

    @property
    def known(self) -> tuple[str | None, Mapping[str, str], Mapping[str, Any]]:
        """Group, tags and settings that were given for it."""
        return self.group, self.tags, self.settings

    def of_cameras(self, cameras: Iterable[CameraSettings]) -> Iterator[DriveEntry]:
        """Yield an entry for each of some cameras; itself where its own camera is given."""
        for camera in () if self.camera else cameras:
            given = {name: own for name, own in asdict(camera).items() if own or own == ""}
            topics = {name: own for name, own in given.items() if name not in ("name", "ground")}
            tables = {"topics": {**self.settings.get("topics", {}), **topics}}
            if camera.ground.given:
                tables["ground"] = {n: own for n, own in given["ground"].items() if own is not None}
            yield replace(self, settings={**self.settings, **tables})
        if self.camera:
            yield self

    def config(self, config: RunConfig) -> RunConfig:
        """Return a run's configuration with what holds for this drive alone."""
        with in_file(self.shown):
            return config.of_drive(self.settings).for_drive(self.source)


def stem_of(source: str) -> str:
    """Return the name of a drive: of a folder, or of a file without its suffix."""
    if is_url(source):
        return PurePath(last_part(source)).stem
    path = Path(source)
    return path.name if path.is_dir() else path.stem


def identity(source: str) -> str:
    """Return the identity of a drive: a word of its name, and a digest of its source.

    >>> identity("s3://bucket/monday, rain.mcap")
    'monday_rain-0195e6ef61ad'
    """
    word = as_plain(stem_of(source))[:LONGEST].strip("-_")
    digest = blake2b(source.encode(errors="surrogateescape"), digest_size=DIGEST)
    return f"{word or 'drive'}-{digest.hexdigest()}"


def entry_of(
    source: str,
    group: str | None = None,
    tags: Mapping[str, str] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> DriveEntry:
    """Make the entry of a drive."""
    name = visible(stem_of(source)) or "drive"
    return DriveEntry(source, identity(source), name, group, dict(tags or {}), settings or {})


def counts(name: str) -> bool:
    """Return whether a file or folder is not hidden, and complete."""
    hidden = name.startswith(".") or name in OF_THE_SYSTEM
    return not hidden and PurePath(name.lower()).suffixes[-2:-1] != [".partial"]


def is_log(name: str) -> bool:
    """Return whether a file that is found in a folder is a log."""
    return name.lower().endswith(".mcap") and counts(name)


def cameras_apart(entries: Sequence[DriveEntry]) -> list[DriveEntry]:
    """Name each of several cameras of a log: a drive's identity and name hold its camera's."""
    cameras = defaultdict[str, list[str]](list)
    for entry in entries:
        cameras[entry.source].append(entry.camera)
    found = []
    for entry in entries:
        if len(own := cameras[entry.source]) > 1:
            short = short_names(own)[entry.camera]
            # Two topics may be the same word: the digest parts them.
            digest = blake2b(entry.camera.encode(), digest_size=DIGEST).hexdigest()
            drive = f"{entry.id}-{as_plain(short)[:LONGEST]}-{digest}"
            name = f"{entry.name} {visible(short)}"
            entry = replace(entry, id=drive, name=name)  # noqa: PLW2901
        found.append(entry)
    return found


def is_bag(folder: Path) -> bool:
    """Return whether a folder is rosbag2's, whose files are one drive."""
    try:
        with (folder / METADATA).open("rb") as file:
            return BAG in file.read(HEAD)
    except OSError:
        return False


def in_order(path: PurePath) -> list[Any]:
    """Sort key by which ``monday/drive_2`` comes before ``monday/drive_10``."""
    return [(natural(Path(part)), part) for part in path.parts]


def groups_of(entries: Sequence[DriveEntry]) -> dict[str, str]:
    """Return the group of each drive by its ID; a single drive is its own group.

    Logs with the same bytes are in one group, together with all other drives of their groups; those
    behind URLs are not compared.
    """
    groups = {entry.id: entry.group or entry.id for entry in entries}
    for same in _alike(entries):
        joined = {groups[entry.id] for entry in same}
        first = groups[same[0].id]
        groups = {drive: first if own in joined else own for drive, own in groups.items()}
    return groups


def _alike(entries: Sequence[DriveEntry]) -> list[list[DriveEntry]]:
    """Return lists of drives with the same files. Only files of equal size are read."""
    same_size = defaultdict[tuple[int, ...], list[tuple[DriveEntry, list[Path]]]](list)
    for entry in entries:
        # A drive that cannot be read is reported when it is replayed.
        with suppress(RoadevalError, OSError):
            if entry.path is not None:
                files = files_of(entry.path)[0]
                same_size[tuple(file.stat().st_size for file in files)].append((entry, files))
    same = defaultdict[tuple[str, ...], list[DriveEntry]](list)
    for logs in same_size.values():
        for entry, files in logs if len(logs) > 1 else ():
            with suppress(OSError):
                same[tuple(map(sha256_of, files))].append(entry)
    return [drives for drives in same.values() if len(drives) > 1]


def deal(groups: Mapping[str, str], folds: int, seed: int) -> dict[str, int]:
    """Split drives into folds; those of a group stay together.

    The groups are shuffled by the digest of seed and name, which depends neither on their order nor
    on the other groups, and distributed in turn: the numbers of groups differ by one at most.
    ``groups`` has the group of each drive, of a single one itself. Returned is the fold of each
    drive, from 0. A `FleetError` if there are fewer groups than folds.

    Examples
    --------
    >>> deal({"a": "monday", "b": "monday", "c": "tuesday"}, 2, seed=0)
    {'a': 1, 'b': 1, 'c': 0}
    """
    names = shuffled(set(groups.values()), seed)
    if len(names) < folds:
        raise FleetError(
            f"{folds} folds need as many drives with truth, or groups of them, and there are "
            f"{len(names)} (copies of one log count as one)",
            setting="fleet.folds",
        )
    fold = {name: place % folds for place, name in enumerate(names)}
    return {drive: fold[group] for drive, group in groups.items()}


def shuffled(names: Iterable[str], seed: int) -> list[str]:
    """Return names in an order that depends on the seed alone, not on their own order."""

    def drawn(name: str) -> bytes:
        return hashlib.blake2b(f"{seed} {name}".encode("utf-8", "surrogateescape")).digest()

    return sorted(names, key=drawn)


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


@dataclass(frozen=True)
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
            raise FleetError.of(error, where) from error
        settings = {name: table[name] for name in OF_A_LOG if name in table}
        for source in sources:
            yield entry_of(source, row.group, row.tags, settings)
