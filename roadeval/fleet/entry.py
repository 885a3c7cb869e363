"""A drive of a fleet: where it lies, how it is called, what is known of it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import blake2b
from pathlib import Path, PurePath
from typing import Any, Final

from roadeval.config import DriveSettings
from roadeval.fleet.urls import is_url, last_part, shown
from roadeval.runtime.text import visible

_DIGEST: Final = 4
"""Bytes of the digest in an identity."""
_LONGEST: Final = 40
"""Letters of a name that its identity keeps: it is part of the names of files and folders."""


@dataclass(frozen=True, slots=True)
class DriveEntry:
    """A drive of a fleet.

    Parameters
    ----------
    source
        An absolute path, or a URL. It may hold a password or a signature, so whatever shows or
        keeps it takes `shown` instead.
    id
        Its identity in the fleet: letters, digits, ``-`` and ``_`` alone.
    name
        Its name for people, fit to be shown; several drives may have one name.
    group
        What it shares with other drives, as a day or a route; None for a drive on its own.
    tags
        What is known of it, as ``{"weather": "rain"}``.
    settings
        What is asked of it in place of what is asked of all; None if nothing is.
    """

    source: str = field(repr=False)
    id: str
    name: str
    group: str | None = None
    tags: Mapping[str, str] = field(default_factory=dict)
    settings: DriveSettings | None = field(default=None, repr=False)

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


def identity(source: str, size: int = _DIGEST) -> str:
    """Return the identity of a drive: a word of its name, and a digest of its source.

    >>> identity("s3://bucket/monday, rain.mcap")
    'monday_rain-39c9a6a7'
    """
    word = re.sub(r"[^A-Za-z0-9_-]+", "_", stem_of(source))[:_LONGEST].strip("-_")
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
