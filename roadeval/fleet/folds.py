"""Drives split into folds: each is scored by a model that was trained on the others."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from roadeval.errors import RoadevalError
from roadeval.fleet.entry import DriveEntry, FleetError
from roadeval.logs import files_of


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
                same[tuple(map(_content, files))].append(entry)
    return [drives for drives in same.values() if len(drives) > 1]


def _content(file: Path) -> str:
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


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
