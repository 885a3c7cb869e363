"""The digest of all that decides what a run finds."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from roadeval import logs
from roadeval.config import ExecutionSettings, FleetSettings, OutputSettings, RunConfig
from roadeval.version import VERSION


def deciding(config: RunConfig) -> RunConfig:
    """Return a configuration without what changes no number: output paths and who computes."""
    output = OutputSettings(record=config.output.record)
    return replace(config, output=output, run=ExecutionSettings(), fleet=FleetSettings())


def identity(log: logs.Log, config: RunConfig, masks: Mapping[str, str] | None = None) -> str:
    """Return a digest of the log, the settings, the model file and the version, in hexadecimal.

    Equal for the same input, wherever log, model and masks lie. ``masks`` are the digests of those
    that lie beside the log, by their variant.

    Raises
    ------
    RoadevalError
        If the disk of one of them fails.
    """
    model = config.training.model
    digest = hashlib.sha256(Path(model).read_bytes()).hexdigest() if model else ""
    return asked(config, digest, of=log.sha256, masks=masks)


def asked(
    config: RunConfig, model: str, *, of: str = "", masks: Mapping[str, Any] | None = None
) -> str:
    """Return a digest of the settings, the version and the SHA-256 of a model file, in hexadecimal.

    With ``of``, the SHA-256 of a log, and what tells the content of masks that lie beside it, it is
    that of all that decides what a run finds. Of stages that are not roadeval's own it holds the
    code of the file that defines them.
    """
    plain = {name: replace(each, path="", images=None) for name, each in config.masks.items()}
    nowhere = "" if config.training.adapt else None  # wherever the file lies
    training = replace(config.training, model=nowhere)
    settings = replace(deciding(config).without_places(), training=training, masks=plain)
    parts = [VERSION, of, json.dumps(settings.as_dict(), sort_keys=True), model]
    if masks:
        parts.append(json.dumps(masks, sort_keys=True))
    parts += config.others_code()
    return hashlib.blake2b("\n".join(parts).encode(), digest_size=16).hexdigest()
