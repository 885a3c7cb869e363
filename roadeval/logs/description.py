"""The description of a log, as plain data."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from roadeval.images import MAX_PIXELS
from roadeval.logs.errors import LogError
from roadeval.logs.log import open_log
from roadeval.logs.settings import LabelSettings, TopicSettings
from roadeval.logs.topics.description import TopicInfo


@dataclass(frozen=True, slots=True)
class LogDescription:
    """What a log holds, what is wrong with it, and what a replay would pick.

    Parameters
    ----------
    path, bytes
        The log, and the size of its files.
    start_ns, end_ns
        Log times of its first and last message.
    topics
        Every topic.
    picks
        What a replay would pick and why, a sentence each.
    problem
        Why a replay could not pick, or empty.
    oddities
        Of the images that a replay would pick: several sizes, repeated ones; a sentence each.
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
    oddities: tuple[str, ...]
    damage: tuple[str, ...]
    losses: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON has it: text, numbers, lists, objects."""
        return asdict(self)


def describe(
    path: str | Path,
    topics: TopicSettings | None = None,
    labels: LabelSettings | None = None,
    *,
    keep_corrupt: bool = False,
    max_pixels: int = MAX_PIXELS,
) -> LogDescription:
    """Read a log whole, so that all damage is found, and describe it.

    Parameters
    ----------
    path
        File or folder.
    topics, labels
        What a replay would be asked for.
    keep_corrupt, max_pixels
        As `open_log` takes them.

    Raises
    ------
    LogError
        If it is missing, unreadable, or no MCAP log.
    """
    with open_log(path, keep_corrupt=keep_corrupt, max_pixels=max_pixels) as log:
        picks: tuple[str, ...] = ()
        oddities: tuple[str, ...] = ()
        problem = ""
        try:
            selection = log.select(topics, labels)
            picks, oddities = selection.reasons, log.oddities(selection)
        except LogError as error:
            problem = str(error)
        log.verify()
        return LogDescription(
            path=str(path),
            bytes=log.size,
            start_ns=log.start_ns,
            end_ns=log.end_ns,
            topics=log.topics,
            picks=picks,
            problem=problem,
            oddities=oddities,
            damage=tuple(map(str, log.damage)),
            losses=log.losses,
        )
