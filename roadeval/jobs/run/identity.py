"""Digests of everything that the results of a run depend on."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

from roadeval import logs
from roadeval.config import ExecutionSettings, FleetSettings, OutputSettings, RunConfig
from roadeval.errors import RoadevalError
from roadeval.version import VERSION

OPENCV: Final = (
    *("opencv-python-headless", "opencv-python"),
    *("opencv-contrib-python-headless", "opencv-contrib-python"),
)
"""The packages that bring OpenCV; without one, its own version is taken."""
COMPUTING: Final = (
    *("numpy", "scipy", "scikit-learn", *OPENCV, "onnxruntime"),
    *("av", "isal", "mcap", "pillow", "simplejpeg"),
)
"""The packages that decode and compute: another version may give other numbers."""


def deciding(config: RunConfig) -> RunConfig:
    """Return a configuration without what changes no number: output paths and who computes."""
    output = OutputSettings(record=config.output.record)
    return replace(config, output=output, run=ExecutionSettings(), fleet=FleetSettings())


@cache
def computing() -> dict[str, str]:
    """Return the versions of the installed packages that compute, and of OpenCV in any case."""
    found = {}
    for package in COMPUTING:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    if not found.keys() & set(OPENCV):
        import cv2

        found["opencv"] = cv2.__version__
    return found


def software(config: RunConfig) -> dict[str, str]:
    """Return the versions of all that computes: roadeval, Python, packages, and others' stages.

    Of a stage that is not roadeval's own it is the digest of its code, see
    `roadeval.runtime.discovery.code_of`. The processor, and how packages were compiled,
    are not included.
    """
    python = ".".join(platform.python_version_tuple()[:2])
    own = {name: code.digest for name, code in config.others_code().items()}
    return {"roadeval": VERSION, "python": python, **computing(), **own}


def identity(log: logs.Log, config: RunConfig, masks: Mapping[str, str] | None = None) -> str:
    """Return a digest of the log, the settings, the model file and the software, in hexadecimal.

    Equal for the same input, in any place of log, model and masks. ``masks`` are the digests of
    those that lie beside the log, by their variant. A `RoadevalError` if the disk of one of them
    fails.
    """
    model = config.training.model
    digest = hashlib.sha256(Path(model).read_bytes()).hexdigest() if model else ""
    return asked(config, digest, of=log.sha256, masks=masks)


def asked(
    config: RunConfig, model: str, *, of: str = "", masks: Mapping[str, Any] | None = None
) -> str:
    """Return a digest of the settings, the software and the SHA-256 of a model, in hexadecimal.

    With ``of``, the SHA-256 of a log, and those of masks that lie beside it, it is that of all that
    decides what a run finds.
    """
    plain = {name: replace(each, path="", images=None) for name, each in config.masks.items()}
    truth = replace(config.truth, path="", images=None)
    nowhere = "" if config.training.adapt else None  # wherever the file lies
    training = replace(config.training, model=nowhere)
    settings = replace(deciding(config).without_places(), training=training, masks=plain)
    settings = replace(settings, truth=truth)
    parts = [settings.as_dict(), software(config), of, model, masks or {}]
    text = json.dumps(parts, sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def content_of(path: Path, config: RunConfig, model: str) -> str | None:
    """Return the `identity` of a replay of a log, which is read whole; None if it cannot be."""
    try:
        with logs.open_log(path, config) as log:
            masks = log.select().digests() if config.masks or config.truth.path else {}
            return asked(config, model, of=log.sha256, masks=masks)
    except RoadevalError:
        return None
