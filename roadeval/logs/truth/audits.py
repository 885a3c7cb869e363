"""Folders of labels that were corrected, and the settings of all others: ``audit.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import TypeAdapter

from roadeval.logs.errors import LogError
from roadeval.logs.settings import AUDIT, LabelPlace, LabelSettings, LogConfig, TopicSettings
from roadeval.runtime.documents import read_bounded, read_json

FORMAT: Final = {"name": "roadeval-audit", "version": 1}
Config = TypeVar("Config", bound=LogConfig)


def without_corrections(config: Config) -> Config | None:
    """Return the settings by which a drive's own labels are read, if the truth is an audit's.

    None if it is none. A `LogError` if the audit is damaged.
    """
    path = Path(config.truth.path, AUDIT)
    if not config.truth.path or not path.is_file():
        return None
    try:
        audit: Mapping[str, Any] = read_json(read_bounded(path))
        truth = TypeAdapter(LabelPlace).validate_python(audit["run"]["truth"])
        labels = TypeAdapter(LabelSettings).validate_python(audit["run"]["labels"])
        topics = TypeAdapter(TopicSettings).validate_python(audit["run"]["topics"])
        if audit["format"] != FORMAT or truth.path == config.truth.path:
            raise ValueError("not as roadeval audit writes it")
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = str(error).partition("\n")[0]
        remedy = "audit into a new folder"
        raise LogError(f"damaged ({reason})", where=path, remedy=remedy) from error
    topics = replace(config.topics, truth=topics.truth)
    labels = labels if config.labels == LabelSettings() else config.labels
    return replace(config, truth=truth, topics=topics, labels=labels)
