"""From words on the command line to what the rooms take."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from roadeval.cli.options import PresetName, split_variant, usage
from roadeval.config import Config, load_config
from roadeval.config import preset as named
from roadeval.logs import LabelValues


def configuration(preset: PresetName | None, file: Path | None) -> Config:
    """Load a preset, or a file of settings on top of it."""
    return load_config(file, preset) if file else named(preset or PresetName.PAPER)


def variants(texts: Sequence[str] | None) -> dict[str, Config]:
    """Load the configurations of ``NAME=FILE.toml`` ..., by name."""
    return {name: load_config(file) for name, file in map(split_variant, texts or ())}


def labels(road: Sequence[int] | None, ignore: Sequence[int] | None) -> LabelValues:
    """Check what the truth's values are said to mean."""
    with usage():
        return LabelValues(tuple(road or ()), tuple(ignore or ()))
