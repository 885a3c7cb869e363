"""The drives of a fleet, as logs, folders, globs, URLs and manifests name them.

A drive has a source (a path or a URL), a name, and perhaps a group, tags and its own settings. A
manifest is a TOML file that lists drives::

    [[drives]]
    path = "monday/*.mcap"              # relative to the manifest; or a URL
    group = "2026-11-16"
    tags = { weather = "rain", vehicle = 7 }
    labels = { road = [3] }             # and topics, frames: in place of those of the run
"""

from __future__ import annotations

import glob
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
from roadeval.runtime.files import Paths, list_paths, reading, sha256_of
from roadeval.runtime.settings import Checked
from roadeval.runtime.text import public_url, visible, without_secrets

BUCKETS: Final = ("s3", "gs")
"""Schemes of stores that keep objects in buckets."""
SCHEMES: Final = (*BUCKETS, "https", "http")

_URL: Final = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://")


class FleetError(RoadevalError):
    """Drives that cannot be found or fetched, or a manifest that cannot be used."""


def is_url(source: str) -> bool:
    """Return whether the source of a drive is a URL, not a path."""
    return _URL.match(source) is not None


def scheme_of(url: str) -> str:
    """Return the scheme of a URL; a `FleetError` if it is none of `SCHEMES`, or has no host."""
    scheme = url.partition("://")[0].lower()
    if scheme not in SCHEMES:
        remedy = f"choose {', '.join(f'{scheme}://' for scheme in SCHEMES)}"
        raise FleetError("an unknown scheme", where=public_source(url), remedy=remedy)
    if scheme in BUCKETS:
        return scheme
    with suppress(ValueError):
        if urlsplit(url).hostname:
            return scheme
    raise FleetError("no host in it", where=public_source(url))


def public_source(source: str) -> str:
    """Return the source of a drive as it may be shown: a URL without user, password and query.

    >>> public_source("https://me:secret@host/a.mcap?X-Amz-Signature=5d1c")
    'https://host/a.mcap'
    """
    return visible(public_url(source) if is_url(source) else without_secrets(source))


def bucket_and_key(url: str) -> tuple[str, str]:
    """Return the bucket and the key in a URL; ``%``, ``?`` and ``#`` are letters of the key."""
    bucket, _, key = url.partition("://")[2].partition("/")
    if "@" in bucket:
        problem = "credentials are read from the environment, not from a URL"
        raise FleetError(problem, where=public_source(url))
    if not bucket:
        raise FleetError("no bucket in it", where=public_source(url))
    return bucket, key


def last_part(url: str) -> str:
    """Return the name of the file, folder or bucket of a URL; empty if it has none."""
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
SYSTEM_FOLDERS: Final = ("lost+found", "System Volume Information")
"""Folders at the top of a disk that cannot be read."""


@dataclass(frozen=True)
class DriveEntry:
    """A drive of a fleet."""

    source: str = field(repr=False)
    """An absolute path, or a URL. It may hold a password or a signature, so messages and files have
    `shown` instead."""
    id: str
    """Its identity in the fleet: letters, digits, ``-`` and ``_`` alone."""
    name: str
    """Its name for people, safe to show; several drives may have the same."""
    group: str | None = None
    """Name that drives of one day or route share; None for a single drive."""
    tags: Mapping[str, str] = field(default_factory=dict)
    """Facts about it, such as ``{"weather": "rain"}``."""
    settings: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """Its own settings, which replace the settings of all drives, see `RunConfig.of_drive`."""

    @property
    def path(self) -> Path | None:
        """The path of its file or folder; None for a URL."""
        return None if is_url(self.source) else Path(self.source)

    @property
    def shown(self) -> str:
        """The source without its secrets."""
        return public_source(self.source)

    @property
    def camera(self) -> str:
        """The topic of its images, if its own settings state that."""
        return str(self.settings.get("topics", {}).get("image", ""))

    @property
    def description(self) -> tuple[str | None, Mapping[str, str], Mapping[str, Any]]:
        """The group, tags and settings that a manifest states."""
        return self.group, self.tags, self.settings

    def of_cameras(self, cameras: Iterable[CameraSettings]) -> Iterator[DriveEntry]:
        """Yield an entry for each camera, or this entry if its own settings state the camera."""
        if self.camera:
            yield self
            return
        for camera in cameras:
            values = {key: value for key, value in asdict(camera).items() if value or value == ""}
            ground = {k: v for k, v in values.pop("ground").items() if v is not None}
            values.pop("name", None)
            tables = {"topics": {**self.settings.get("topics", {}), **values}}
            if camera.ground.given:
                tables["ground"] = ground
            yield replace(self, settings={**self.settings, **tables})

    def config(self, config: RunConfig) -> RunConfig:
        """Return the configuration of a run with the settings of this drive."""
        with in_file(self.shown):
            return config.of_drive(self.settings).for_drive(self.source)


def stem_of(source: str) -> str:
    """Return the name of a drive: its folder's name, or its file's name without the suffix."""
    if is_url(source):
        return PurePath(last_part(source)).stem
    path = Path(source)
    return path.name if path.is_dir() else path.stem


def identity(source: str) -> str:
    """Return the identity of a drive: its name as a word, and a digest of its source.

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


def is_usable(name: str) -> bool:
    """Return whether a file or folder is neither hidden nor partial, by its name."""
    is_hidden = name.startswith(".") or name in SYSTEM_FOLDERS
    return not is_hidden and PurePath(name.lower()).suffixes[-2:-1] != [".partial"]


def is_log(name: str) -> bool:
    """Return whether the name of a file in a folder is that of a log."""
    return name.lower().endswith(".mcap") and is_usable(name)


def name_cameras(entries: Sequence[DriveEntry]) -> list[DriveEntry]:
    """Return drives with the camera in identity and name, if the log has several cameras."""
    cameras = defaultdict[str, list[str]](list)
    for entry in entries:
        cameras[entry.source].append(entry.camera)
    named = []
    for entry in entries:
        topics = cameras[entry.source]
        if len(topics) > 1:
            short = short_names(topics)[entry.camera]
            # Two topics may make the same word, so that only the digest differs.
            digest = blake2b(entry.camera.encode(), digest_size=DIGEST).hexdigest()
            drive = f"{entry.id}-{as_plain(short)[:LONGEST]}-{digest}"
            named.append(replace(entry, id=drive, name=f"{entry.name} {visible(short)}"))
        else:
            named.append(entry)
    return named


def is_bag(folder: Path) -> bool:
    """Return whether a folder is one of rosbag2; its files are one drive."""
    try:
        with (folder / METADATA).open("rb") as file:
            return BAG in file.read(HEAD)
    except OSError:
        return False


def natural_path(path: PurePath) -> list[Any]:
    """Sort key that puts ``monday/drive_2`` before ``monday/drive_10``."""
    return [(natural(Path(part)), part) for part in path.parts]


def groups_of(entries: Sequence[DriveEntry]) -> dict[str, str]:
    """Return the group of each drive by its ID; a single drive is its own group.

    Logs with the same bytes are in one group, together with all other drives of their groups. Logs
    behind URLs are not compared.
    """
    same_size = defaultdict[tuple[int, ...], list[tuple[DriveEntry, list[Path]]]](list)
    for entry in entries:
        # A drive that cannot be read is reported when it is replayed.
        with suppress(RoadevalError, OSError):
            if entry.path is not None:
                files = files_of(entry.path)[0]
                same_size[tuple(file.stat().st_size for file in files)].append((entry, files))
    same_bytes = defaultdict[tuple[str, ...], list[DriveEntry]](list)
    for logs in same_size.values():
        for entry, files in logs if len(logs) > 1 else ():
            with suppress(OSError):
                same_bytes[tuple(map(sha256_of, files))].append(entry)
    groups = {entry.id: entry.group or entry.id for entry in entries}
    for copies in (copies for copies in same_bytes.values() if len(copies) > 1):
        joined = {groups[entry.id] for entry in copies}
        first = groups[copies[0].id]
        groups = {drive: first if group in joined else group for drive, group in groups.items()}
    return groups


def deal(groups: Mapping[str, str], folds: int, seed: int) -> dict[str, int]:
    """Return the fold of each drive, from 0; the drives of a group are in one fold.

    The groups are sorted by a digest of seed and name, which depends neither on their order nor on
    the other groups. The folds get them in turn, so that their numbers of groups differ by one at
    most. ``groups`` has the group of each drive; a single drive is its own group. A `FleetError` if
    there are fewer groups than folds.

    Examples
    --------
    >>> deal({"a": "monday", "b": "monday", "c": "tuesday"}, 2, seed=0)
    {'a': 1, 'b': 1, 'c': 0}
    """
    names = shuffle(set(groups.values()), seed)
    if len(names) < folds:
        raise FleetError(
            f"{folds} folds need as many drives with truth, or groups of them, and there are "
            f"{len(names)} (copies of one log count as one)",
            setting="fleet.folds",
        )
    fold = {name: place % folds for place, name in enumerate(names)}
    return {drive: fold[group] for drive, group in groups.items()}


def shuffle(names: Iterable[str], seed: int) -> list[str]:
    """Return names in an order that depends on the seed, not on their own order."""

    def digest(name: str) -> bytes:
        return blake2b(f"{seed} {name}".encode("utf-8", "surrogateescape")).digest()

    return sorted(names, key=digest)


MANIFEST: Final = ".toml"
"""The ending of a manifest's name."""


def find_drives(words: Paths) -> list[DriveEntry]:
    """Return the drives that some words name, in their order.

    A word is a log (a file of any name), a rosbag2 folder, a folder that is searched for logs and
    rosbag2 folders, a glob, a URL, or a manifest (``.toml``). The drives of a folder come in
    natural order, without hidden and incomplete files. A file of a rosbag2 folder stands for the
    folder. If a drive is named twice, it counts once, with its description in a manifest; but two
    cameras that a manifest names are two drives. A `RoadevalError` if a word leads to no drive, a
    manifest cannot be used, or a drive has two descriptions.
    """
    first_of: dict[tuple[str, str], DriveEntry] = {}
    bare: tuple[Any, ...] = (None, {}, {})
    entries: list[DriveEntry] = []
    for word in map(str, list_paths(words)):
        with reading(visible(word), FleetError):
            path = Path(word)
            if is_url(word) or path.suffix != MANIFEST or not path.is_file():
                entries += map(entry_of, _sources(word, Path()))
            else:
                entries += read_manifest(path)
    for entry in entries:
        place = entry.source if entry.path is None else os.path.realpath(entry.path)
        first = first_of.setdefault((place, entry.camera), entry)
        if first.description == bare != entry.description:
            first_of[place, entry.camera] = entry
        elif entry.description not in (first.description, bare):
            problem = "is named twice, with different groups, tags or settings"
            raise FleetError(problem, where=entry.shown)
    if not first_of:
        raise FleetError("no drive found", remedy="name logs, folders of logs, URLs or a manifest")
    return name_cameras([*first_of.values()])


def _sources(word: str, base: Path) -> list[str]:
    """Return the sources of the drives that a word names; a path is relative to ``base``."""
    if is_url(word):
        scheme_of(word)
        if word.endswith("/"):
            remedy = "name its logs, or a manifest of them"
            raise FleetError("a folder", where=public_source(word), remedy=remedy)
        _check_no_manifest(Path(last_part(word)))
        return [word]
    path = base / Path(word).expanduser()
    where = visible(str(path))
    if path.is_dir():
        drives = _find_below(path)
        if not drives:
            files_of(path)  # its error says what is there, and how to convert it
            raise FleetError("no log that is complete, here or below", where=where)
    elif path.exists():
        drives = [path]
    elif glob.has_magic(word):
        names = glob.glob(word, root_dir=base, recursive=True)  # noqa: PTH207
        paths = [base / name for name in names]
        # ``*`` and ``**`` match only logs.
        accepts = is_log if Path(word).name in ("*", "**") else is_usable
        matches = {path for path in paths if not path.is_dir() and accepts(path.name)}
        for folder in filter(Path.is_dir, paths):
            matches.update(_find_below(folder))
        if not matches:
            raise FleetError("no log matches it", where=visible(word))
        drives = sorted(matches, key=natural_path)
    else:
        raise FleetError("there is no such file or folder", where=where)
    sources = []
    for drive in drives:
        _check_no_manifest(drive)
        # A link keeps its own name.
        full = drive.resolve() if drive.name in ("", "..") else drive.parent.resolve() / drive.name
        # Files of a rosbag2 folder would be several drives that share a day, a road and a camera.
        is_in_bag = is_log(full.name) and is_bag(full.parent)
        sources.append(str(full.parent if is_in_bag else full))
    return sources


def _check_no_manifest(path: Path) -> None:
    if path.suffix == MANIFEST:
        problem = "a manifest is named by itself, by its path"
        raise FleetError(problem, where=visible(str(path)))


def _find_below(folder: Path) -> list[Path]:
    """Return the logs and rosbag2 folders in a folder and all below it, in natural order."""

    def refuse(error: OSError) -> None:
        where = visible(str(error.filename))
        raise FleetError(error.strerror or str(error), where=where) from error

    drives: list[Path] = []
    visited: set[Path] = set()
    for name, folders, files in os.walk(folder, onerror=refuse, followlinks=True):
        here = Path(name)
        if here.resolve() in visited:
            folders.clear()
            continue
        visited.add(here.resolve())
        folders[:] = sorted(filter(is_usable, folders))
        drives += [here] if is_bag(here) else [here / file for file in files if is_log(file)]
    return sorted(drives, key=lambda path: natural_path(path.relative_to(folder)))


def _check_tag(name: Any) -> Any:
    if not is_plain(name):
        raise ValueError("a tag's name is made of letters, digits, '-' and '_' alone")
    return name


def _as_word(value: Any) -> str:
    if not isinstance(value, str | int | float) or value == "":
        raise ValueError("must be text, a number, true or false")
    return str(value).lower() if isinstance(value, bool) else str(value)


Word = Annotated[str, Checked(_as_word)]


@dataclass(frozen=True)
class ManifestEntry(LogConfig):
    """An entry of a manifest: one drive or several, and their own settings."""

    path: str = ""
    group: Word | None = None
    tags: Mapping[Annotated[str, Checked(_check_tag)], Word] = field(default_factory=dict)


def read_manifest(path: Path) -> Iterator[DriveEntry]:
    """Yield the drives of a manifest.

    A `RoadevalError` if it cannot be read, names no drive, or has a key, a tag or a setting that
    cannot be used.
    """
    tables = read_tables(path)
    drives = tables.get("drives")
    if not isinstance(drives, list) or not drives or len(tables) > 1:
        problem = "a manifest has [[drives]], one for each drive, and nothing else"
        raise FleetError(problem, where=path)
    for number, table in enumerate(drives, 1):
        where = f"{path}: [[drives]] number {number}"
        with in_file(where):
            entry = override(ManifestEntry(), table, "drives")
        if not entry.path:
            raise FleetError("path must name a log, or several as *.mcap", where=where)
        try:
            sources = _sources(entry.path, path.parent)
        except RoadevalError as error:
            raise FleetError.of(error, where) from error
        settings = {name: table[name] for name in OF_A_LOG if name in table}
        for source in sources:
            yield entry_of(source, entry.group, entry.tags, settings)
