"""A drive of a fleet: its source, a path or a URL, its name, group, tags and fold."""

from __future__ import annotations

import hashlib
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from hashlib import blake2b
from pathlib import Path, PurePath
from typing import Any, Final
from urllib.parse import unquote, urlsplit

from roadeval.config import RunConfig, in_file
from roadeval.data import as_plain
from roadeval.data.words import short_names
from roadeval.errors import RoadevalError
from roadeval.logs import METADATA, files_of, natural
from roadeval.runtime.files import sha256_of
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


@dataclass(frozen=True, slots=True)
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
            f"`fleet.folds`: {folds} folds need as many drives with truth, or groups of them, "
            f"and there are {len(names)} (copies of one log count as one)"
        )
    fold = {name: place % folds for place, name in enumerate(names)}
    return {drive: fold[group] for drive, group in groups.items()}


def shuffled(names: Iterable[str], seed: int) -> list[str]:
    """Return names in an order that depends on the seed alone, not on their own order."""

    def drawn(name: str) -> bytes:
        return hashlib.blake2b(f"{seed} {name}".encode("utf-8", "surrogateescape")).digest()

    return sorted(names, key=drawn)
