"""Folders of corrected labels, and in ``audit.json`` the settings of the drive's other labels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import TypeAdapter

from roadeval.logs.errors import LogError
from roadeval.logs.settings import AUDIT, LabelSettings, LogConfig
from roadeval.runtime.documents import read_bounded, read_json

FORMAT: Final = {"name": "roadeval-audit", "version": 1}
Config = TypeVar("Config", bound=LogConfig)


def without_corrections(config: Config) -> tuple[Config, list[str]]:
    """Return settings that read a drive's own labels, and the folders of audits that correct them.

    An audit may correct an earlier one: the latest audit is first. A `LogError` if one is damaged.
    """
    folders = list[str]()
    while config.truth.path and (path := Path(config.truth.path, AUDIT)).is_file():
        folders.append(config.truth.path)
        try:
            audit: Mapping[str, Any] = read_json(read_bounded(path))
            before = TypeAdapter(LogConfig).validate_python(audit["run"])
            if audit["format"] != FORMAT or before.truth.path in folders:
                raise ValueError("not as roadeval audit writes it")
        except (OSError, ValueError, KeyError, TypeError, LogError) as error:
            reason = str(error).partition("\n")[0]
            remedy = "audit into a new folder"
            raise LogError(f"damaged ({reason})", where=path, remedy=remedy) from error
        topics = replace(config.topics, truth=before.topics.truth)
        labels = before.labels if config.labels == LabelSettings() else config.labels
        config = replace(config, truth=before.truth, topics=topics, labels=labels)
    return config, folders
