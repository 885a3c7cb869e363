"""What is asked of a log alone: all that it takes to look at one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from roadeval.config.override import override
from roadeval.logs.settings import FrameSettings, LabelSettings, LogConfig, TopicSettings


def log_config(tables: Mapping[str, Any]) -> LogConfig:
    """Return the defaults with the values of some tables in place.

    Raises
    ------
    ConfigError
        For a key or a value that cannot be used; names it, and what is allowed.
    """
    return LogConfig(
        topics=override(TopicSettings(), tables, "topics"),
        labels=override(LabelSettings(), tables, "labels"),
        frames=override(FrameSettings(), tables, "frames"),
    )
