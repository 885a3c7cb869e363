"""What a result must say about where it comes from: versions, settings, the log."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Final

from roadeval.config import Variant
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.training import TrainingSettings
from roadeval.version import VERSION

PACKAGES: Final = (
    *("mcap", "numpy", "opencv-python-headless", "scikit-learn", "scipy"),
    *("numba", "rerun-sdk", "pandas", "matplotlib"),
)
"""The packages whose version can change a number or a file."""


def versions() -> dict[str, str]:
    """Give the versions of roadeval, Python and the packages that matter."""
    found = {"roadeval": VERSION, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def settings(
    variants: Sequence[Variant], training: TrainingSettings, evaluation: EvaluationSettings
) -> dict[str, Any]:
    """Give every variant's effective settings, in the shape of its TOML file.

    ``training`` and ``evaluation`` are the run's: all its variants are trained and scored alike.
    """
    configs = {
        v.name: replace(v.config, training=training, evaluation=evaluation) for v in variants
    }
    return {name: config.as_dict() for name, config in configs.items()}
