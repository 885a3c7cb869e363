"""Drives whose logs are copies of one another, found before any of them is replayed."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from roadeval.errors import RoadevalError
from roadeval.fleet.entry import DriveEntry
from roadeval.logs.files import files_of


def groups_of(entries: Sequence[DriveEntry]) -> dict[str, str]:
    """Return the group of each drive by its ID; one that stands alone is its own.

    Logs with the same bytes are in one group, and so is whoever else is in a group of one of them.
    Only files that are as long as another drive's are read; those behind URLs are not compared.
    """
    groups = {entry.id: entry.group or entry.id for entry in entries}
    for same in _alike(entries):
        joined = {groups[entry.id] for entry in same}
        first = groups[same[0].id]
        groups = {drive: first if own in joined else own for drive, own in groups.items()}
    return groups


def _alike(entries: Sequence[DriveEntry]) -> Iterable[list[DriveEntry]]:
    """Yield drives whose files have the same bytes, in their order."""
    by_size = defaultdict[tuple[int, ...], list[tuple[DriveEntry, list[Path]]]](list)
    for entry in entries:
        # Whoever cannot be read is told of when it is replayed.
        with suppress(RoadevalError, OSError):
            if entry.path is not None:
                files, _ = files_of(entry.path)
                by_size[tuple(file.stat().st_size for file in files)].append((entry, files))
    for candidates in by_size.values():
        by_content = defaultdict[tuple[bytes, ...], list[DriveEntry]](list)
        for entry, files in candidates if len(candidates) > 1 else ():
            with suppress(OSError):
                by_content[tuple(map(_digest, files))].append(entry)
        yield from (same for same in by_content.values() if len(same) > 1)


def _digest(file: Path) -> bytes:
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").digest()
