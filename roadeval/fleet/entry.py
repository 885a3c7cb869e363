"""A drive of a fleet: where it lies, how it is called, what is known of it; which files are one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import blake2b
from pathlib import Path, PurePath
from typing import Any, Final

from roadeval.config import DriveSettings
from roadeval.fleet.urls import is_url, last_part, shown
from roadeval.logs import METADATA, natural
from roadeval.runtime.text import visible

DIGEST: Final = 4
"""Bytes of the digest in an identity."""
LONGEST: Final = 40
"""Letters of a name that its identity keeps: it is part of the names of files and folders."""
HEAD: Final = 4096
"""Bytes of rosbag2's `METADATA` in which its heading stands."""
BAG: Final = b"rosbag2_bagfile_information"
OF_THE_SYSTEM: Final = ("lost+found", "System Volume Information")
"""Folders at the top of a disk that nobody may read."""


@dataclass(frozen=True, slots=True)
class DriveEntry:
    """A drive of a fleet."""

    source: str = field(repr=False)
    """An absolute path, or a URL. It may hold a password or a signature, so whatever shows or keeps
    it takes `shown` instead."""
    id: str
    """Its identity in the fleet: letters, digits, ``-`` and ``_`` alone."""
    name: str
    """Its name for people, fit to be shown; several drives may have one name."""
    group: str | None = None
    """What it shares with other drives, as a day or a route; None for a drive on its own."""
    tags: Mapping[str, str] = field(default_factory=dict)
    """What is known of it, as ``{"weather": "rain"}``."""
    settings: DriveSettings | None = field(default=None, repr=False)
    """What is asked of it in place of what is asked of all; None if nothing is."""

    @property
    def path(self) -> Path | None:
        """The path of its file or folder; None for a URL."""
        return None if is_url(self.source) else Path(self.source)

    @property
    def shown(self) -> str:
        """The source without what is secret in it."""
        return shown(self.source)

    @property
    def known(self) -> tuple[str | None, Mapping[str, str], Mapping[str, Any]]:
        """Group, tags and tables of settings that were given for it."""
        return self.group, self.tags, self.settings.tables if self.settings else {}


def stem_of(source: str) -> str:
    """Return the name of a drive: of a folder, or of a file without its suffix."""
    if is_url(source):
        name = last_part(source)
        return name if source.endswith("/") else PurePath(name).stem
    path = Path(source)
    return path.name if path.is_dir() else path.stem


def identity(source: str, size: int = DIGEST) -> str:
    """Return the identity of a drive: a word of its name, and a digest of its source.

    >>> identity("s3://bucket/monday, rain.mcap")
    'monday_rain-39c9a6a7'
    """
    word = re.sub(r"[^A-Za-z0-9_-]+", "_", stem_of(source))[:LONGEST].strip("-_")
    digest = blake2b(source.encode(errors="surrogateescape"), digest_size=size)
    return f"{word or 'drive'}-{digest.hexdigest()}"


def entry_of(
    source: str,
    group: str | None = None,
    tags: Mapping[str, str] | None = None,
    settings: DriveSettings | None = None,
) -> DriveEntry:
    """Make the entry of a drive from its source and what is known of it."""
    name = visible(stem_of(source)) or "drive"
    return DriveEntry(source, identity(source), name, group, dict(tags or {}), settings)


def counts(name: str) -> bool:
    """Return whether a file or folder is looked at: it is not hidden, and is complete."""
    hidden = name.startswith(".") or name in OF_THE_SYSTEM
    return not hidden and PurePath(name.lower()).suffixes[-2:-1] != [".partial"]


def is_log(name: str) -> bool:
    """Return whether a file that nobody named is a log."""
    return name.lower().endswith(".mcap") and counts(name)


def is_heading(head: bytes) -> bool:
    """Return whether a file begins as rosbag2's `METADATA` does."""
    return BAG in head


def is_bag(folder: Path) -> bool:
    """Return whether a recorder of ROS 2 wrote a folder: its files are one drive."""
    try:
        with (folder / METADATA).open("rb") as file:
            return is_heading(file.read(HEAD))
    except OSError:
        return False


def in_order(path: PurePath) -> list[Any]:
    """Sort key by which ``monday/drive_2`` comes before ``monday/drive_10``."""
    return [(natural(Path(part)), part) for part in path.parts]
