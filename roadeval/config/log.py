"""What is asked of a log alone: all that it takes to look at one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from roadeval.config.override import override
from roadeval.logs.settings import FrameSettings, LabelSettings, TopicSettings


@dataclass(frozen=True, slots=True)
class LogConfig:
    """The part of a run's configuration that is about its log, without stages and their settings.

    Parameters
    ----------
    topics, labels, frames
        As in `roadeval.config.RunConfig`.
    """

    topics: TopicSettings = field(default_factory=TopicSettings)
    labels: LabelSettings = field(default_factory=LabelSettings)
    frames: FrameSettings = field(default_factory=FrameSettings)

    @classmethod
    def of(cls, tables: Mapping[str, Any]) -> LogConfig:
        """Return the defaults with the values of some tables in place.

        Raises
        ------
        ConfigError
            For a key or a value that cannot be used; names it, and what is allowed.
        """
        return cls(
            topics=override(TopicSettings(), tables, "topics"),
            labels=override(LabelSettings(), tables, "labels"),
            frames=override(FrameSettings(), tables, "frames"),
        )
