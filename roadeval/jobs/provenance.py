"""What a result must say about where it comes from: versions, settings, the log."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import fields, replace
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, Final

from roadeval.config import Variant
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.training import TrainingSettings
from roadeval.version import VERSION

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

PACKAGES: Final = (
    *("mcap", "numpy", "opencv-python-headless", "scikit-learn", "scipy"),
    *("numba", "rerun-sdk", "pandas", "matplotlib"),
)
"""The packages whose version can change a number or a file."""

ELSEWHERE: Final = ("config", "variants", "model", "train_frames", "train_gap", "jobs")
"""Options that the summary tells under ``settings`` or ``training``, or that change no number."""


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


def selection(options: DataclassInstance) -> dict[str, Any]:
    """Give what was asked of the log, by the options' names: topics, labels, range, stride.

    None stands for an option that was not given, so that its default held.
    """
    named = (field.name for field in fields(options))
    return {name: getattr(options, name) for name in named if name not in ELSEWHERE}
