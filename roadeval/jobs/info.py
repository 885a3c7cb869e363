"""Describe a log, and what a replay would pick of it."""

from __future__ import annotations

from functools import partial

from roadeval import logs
from roadeval.config import RunConfig
from roadeval.jobs.outputs import AnyPath
from roadeval.jobs.run import select


def info(drive: AnyPath, config: RunConfig | None = None) -> logs.LogDescription:
    """Describe a log: topics, rates, gaps, damage, and what a replay would pick and why.

    Raises
    ------
    RoadevalError
        If it is no log, or cannot be read.
    """
    config = config or RunConfig()
    return logs.describe(
        drive, partial(select, config=config), keep_corrupt=config.frames.keep_corrupt
    )
