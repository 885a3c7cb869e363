"""Drives whose logs are copies of one another, found before any of them is replayed."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.fleet.entry import DriveEntry
from roadeval.logs import files_of

END: Final = 1 << 16
"""Bytes at a file's end that are compared first."""
Log = tuple[DriveEntry, list[Path]]
"""A drive, and its files."""


def groups_of(entries: Sequence[DriveEntry]) -> dict[str, str]:
    """Return the group of each drive by its ID; one that stands alone is its own.

    Logs with the same bytes are in one group, together with all other drives of their groups. Only
    files of the same size and end are read as a whole; those behind URLs are not compared.
    """
    groups = {entry.id: entry.group or entry.id for entry in entries}
    for same in _alike(entries):
        joined = {groups[entry.id] for entry in same}
        first = groups[same[0].id]
        groups = {drive: first if own in joined else own for drive, own in groups.items()}
    return groups


def _alike(entries: Sequence[DriveEntry]) -> Iterable[list[DriveEntry]]:
    """Yield drives whose files have the same bytes, in their order."""
    logs = []
    for entry in entries:
        # A drive that cannot be read is reported when it is replayed.
        with suppress(RoadevalError):
            if entry.path is not None:
                logs.append((entry, files_of(entry.path)[0]))
    same_size = _grouped(logs, lambda file: file.stat().st_size)
    same_end = (each for group in same_size for each in _grouped(group, _end))
    for group in same_end:
        for same in _grouped(group, _digest):
            yield [entry for entry, _ in same]


def _grouped(logs: Sequence[Log], of: Callable[[Path], object]) -> list[list[Log]]:
    """Return the logs of whose files something is the same, where there are several."""
    found = defaultdict[tuple[object, ...], list[Log]](list)
    for entry, files in logs:
        with suppress(OSError):
            found[tuple(map(of, files))].append((entry, files))
    return [same for same in found.values() if len(same) > 1]


def _end(file: Path) -> bytes:
    """Return the end of a file, where a log has its counts, times and checksums."""
    with file.open("rb") as opened:
        opened.seek(max(0, file.stat().st_size - END))
        return opened.read(END)


def _digest(file: Path) -> bytes:
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").digest()
