"""Which drives of two fleets are the same: by their identity, else by their log."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class LeftOutBecause(StrEnum):
    """Why a drive of one fleet is not compared."""

    ONLY_THERE = "the other fleet does not have it"
    NOT_SCORED = "not scored in both"
    OTHER_LOG = "its log has changed"
    NO_FRAME = "no evaluated frame in common"


@dataclass(frozen=True, slots=True)
class FleetDrive:
    """A drive to be matched: its log's SHA-256, where known, and whether it was scored."""

    sha256: str | None
    scored: bool


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A drive that is not compared: the fleet, ``base`` or ``new``, that has it, and why."""

    drive: str
    fleet: str
    because: LeftOutBecause


@dataclass(frozen=True, slots=True)
class Matched:
    """Drives of two fleets.

    Parameters
    ----------
    pairs
        The base's identity and the new fleet's of drives that both have scored.
    by_log
        How many of them go by other identities, and are the same by their log.
    left_out
        All other drives.
    """

    pairs: tuple[tuple[str, str], ...]
    by_log: int
    left_out: tuple[LeftOut, ...]


def match_drives(base: Mapping[str, FleetDrive], new: Mapping[str, FleetDrive]) -> Matched:
    """Match the drives of two fleets, each by its identity, in the base's order.

    One identity with two different logs is no match: the difference would be the scene's.
    """
    logs = _by_log({drive: each for drive, each in new.items() if drive not in base})
    pairs, left, by_log = [], [], 0
    taken = set()
    for drive, each in base.items():
        other = drive if drive in new else _next(logs, each.sha256)
        if other is None:
            left.append(LeftOut(drive, "base", LeftOutBecause.ONLY_THERE))
            continue
        taken.add(other)
        if reason := _why_not(each, new[other]):
            left.append(LeftOut(drive, "base", reason))
        else:
            pairs.append((drive, other))
            by_log += other != drive
    left += (LeftOut(d, "new", LeftOutBecause.ONLY_THERE) for d in new if d not in taken)
    return Matched(tuple(pairs), by_log, tuple(left))


def _by_log(drives: Mapping[str, FleetDrive]) -> Mapping[str | None, deque[str]]:
    found: defaultdict[str | None, deque[str]] = defaultdict(deque)
    for drive, each in drives.items():
        if each.sha256:
            found[each.sha256].append(drive)
    return found


def _next(logs: Mapping[str | None, deque[str]], sha256: str | None) -> str | None:
    """Return a drive of a log that is not matched yet: a log may be in a fleet twice."""
    found = logs.get(sha256)
    return found.popleft() if found else None


def _why_not(base: FleetDrive, new: FleetDrive) -> LeftOutBecause | None:
    if base.sha256 and new.sha256 and base.sha256 != new.sha256:
        return LeftOutBecause.OTHER_LOG
    return None if base.scored and new.scored else LeftOutBecause.NOT_SCORED
