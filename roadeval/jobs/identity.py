"""The digest of all that decides what a run finds."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

from roadeval import logs
from roadeval.config import ExecutionSettings, OutputSettings, RunConfig
from roadeval.version import VERSION


def deciding(config: RunConfig) -> RunConfig:
    """Return a configuration without what changes no number: output paths and worker threads."""
    output = OutputSettings(record=config.output.record)
    return replace(config, output=output, run=ExecutionSettings())


def identity(log: logs.Log, config: RunConfig) -> str:
    """Return a digest of the log, the settings, the model file and the version, in hexadecimal.

    Equal for the same input, wherever log and model lie.

    Raises
    ------
    RoadevalError
        If the disk of the log fails.
    """
    model = config.training.model
    settings = replace(deciding(config), training=replace(config.training, model=None))
    parts = [
        VERSION,
        log.sha256,
        json.dumps(settings.as_dict(), sort_keys=True),
        hashlib.sha256(Path(model).read_bytes()).hexdigest() if model else "",
    ]
    return hashlib.blake2b("\n".join(parts).encode(), digest_size=16).hexdigest()
