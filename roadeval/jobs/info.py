"""Describe a log, and what a replay would pick of it."""

from __future__ import annotations

from pathlib import Path

from roadeval import logs


def info(drive: str | Path, config: logs.LogConfig | None = None) -> logs.LogDescription:
    """Describe a log: topics, rates, gaps, damage, and what a replay would pick and why.

    Raises
    ------
    RoadevalError
        If it is no log, or cannot be read.
    """
    return logs.describe(drive, config)
