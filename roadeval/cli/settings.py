"""From words on the command line to configurations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from roadeval.cli.options import PresetName, split_variant
from roadeval.config import Config, load_config
from roadeval.config import preset as named


def configuration(preset: PresetName | None, file: Path | None) -> Config:
    """Load a preset, or a file of settings on top of it."""
    return load_config(file, preset) if file else named(preset or PresetName.PAPER)


def variants(texts: Sequence[str] | None) -> dict[str, Config]:
    """Load the configurations of ``NAME=FILE.toml`` ..., by name."""
    return {name: load_config(file) for name, file in map(split_variant, texts or ())}
