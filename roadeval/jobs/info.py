"""Describe a log, and what a replay would pick of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from roadeval import logs
from roadeval.config import LogConfig

if TYPE_CHECKING:
    from roadeval.config import RunConfig


def info(drive: str | Path, config: RunConfig | LogConfig | None = None) -> logs.LogDescription:
    """Describe a log: topics, rates, gaps, damage, and what a replay would pick and why.

    Raises
    ------
    RoadevalError
        If it is no log, or cannot be read.
    """
    config = config or LogConfig()
    return logs.describe(
        drive,
        config.topics,
        config.labels,
        keep_corrupt=config.frames.keep_corrupt,
        max_pixels=config.frames.max_pixels,
    )
