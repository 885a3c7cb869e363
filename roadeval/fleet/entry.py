"""A drive of a fleet: its source, name, group and tags; and which files count as one."""

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
    settings: DriveSettings | None = field(default=None, repr=False)
    """Settings of it alone, in place of those of all drives."""

    @property
    def path(self) -> Path | None:
        """The path of its file or folder; None for a URL."""
        return None if is_url(self.source) else Path(self.source)

    @property
    def shown(self) -> str:
        """The source without its secrets."""
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
    """Make the entry of a drive."""
    name = visible(stem_of(source)) or "drive"
    return DriveEntry(source, identity(source), name, group, dict(tags or {}), settings)


def counts(name: str) -> bool:
    """Return whether a file or folder is not hidden, and complete."""
    hidden = name.startswith(".") or name in OF_THE_SYSTEM
    return not hidden and PurePath(name.lower()).suffixes[-2:-1] != [".partial"]


def is_log(name: str) -> bool:
    """Return whether a file that is found in a folder is a log."""
    return name.lower().endswith(".mcap") and counts(name)


def is_heading(head: bytes) -> bool:
    """Return whether a file begins as rosbag2's `METADATA` does."""
    return BAG in head


def is_bag(folder: Path) -> bool:
    """Return whether a folder is rosbag2's, whose files are one drive."""
    try:
        with (folder / METADATA).open("rb") as file:
            return is_heading(file.read(HEAD))
    except OSError:
        return False


def in_order(path: PurePath) -> list[Any]:
    """Sort key by which ``monday/drive_2`` comes before ``monday/drive_10``."""
    return [(natural(Path(part)), part) for part in path.parts]
