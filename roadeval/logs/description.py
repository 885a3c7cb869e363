"""All that there is to say about a log, as plain data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from roadeval.logs.errors import LogError
from roadeval.logs.log import Log, open_log
from roadeval.logs.topics.description import TopicInfo
from roadeval.logs.topics.selection import Selection


@dataclass(frozen=True, slots=True)
class LogDescription:
    """What a log holds, what is wrong with it, and what a replay would pick.

    Parameters
    ----------
    path, bytes
        Where it lies, and the size of its files.
    start_ns, end_ns
        Log times of its first and last message.
    topics
        Every topic.
    picks
        What a replay would pick and why, a sentence each.
    problem
        Why a replay could not pick, or empty.
    damage, losses
        What is wrong with the files, and what is lost by it, a sentence each.
    """

    path: str
    bytes: int
    start_ns: int
    end_ns: int
    topics: tuple[TopicInfo, ...]
    picks: tuple[str, ...]
    problem: str
    damage: tuple[str, ...]
    losses: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Give it as JSON has it: text, numbers, lists, objects."""
        return asdict(self)


def describe(
    path: str | Path,
    select: Callable[[Log], Selection] = Log.select,
    *,
    keep_corrupt: bool = False,
) -> LogDescription:
    """Read a log whole, so that all damage is found, and describe it.

    Parameters
    ----------
    path
        File or folder.
    select
        Settles what a replay would pick.
    keep_corrupt
        Whether data with a wrong checksum count as readable.

    Raises
    ------
    LogError
        If it is missing, unreadable, or no MCAP log.
    """
    with open_log(path, keep_corrupt=keep_corrupt) as log:
        log.verify()
        picks: tuple[str, ...] = ()
        problem = ""
        try:
            picks = select(log).reasons
        except LogError as error:
            problem = str(error)
        return LogDescription(
            str(path),
            log.size,
            log.start_ns,
            log.end_ns,
            log.topics,
            picks,
            problem,
            tuple(map(str, log.damage)),
            log.losses,
        )
