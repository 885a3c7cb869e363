"""From words on the command line to what the rooms take."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from roadeval.cli.options import PresetName, color, split_mask, split_variant, usage
from roadeval.config import Config, load_config, override
from roadeval.config import preset as named
from roadeval.logs import LabelSettings


def configuration(preset: PresetName | None, file: Path | None) -> Config:
    """Load a preset, or a file of settings on top of it."""
    return load_config(file, preset) if file else named(preset or PresetName.PAPER)


def variants(texts: Sequence[str] | None) -> dict[str, Config]:
    """Load the configurations of ``NAME=FILE.toml`` ..., by name."""
    return {name: load_config(file) for name, file in map(split_variant, texts or ())}


def masks(texts: Sequence[str] | None) -> dict[str, str]:
    """Read the topics of ``NAME=TOPIC`` ..., by name."""
    return dict(map(split_mask, texts or ()))


def labels(
    road: Sequence[int] | None,
    ignore: Sequence[int] | None,
    road_colors: Sequence[str] | None = None,
    ignore_colors: Sequence[str] | None = None,
) -> LabelSettings:
    """Check what the truth's values, or colours, are said to mean."""
    given = {
        "road": tuple(road or ()),
        "ignore": tuple(ignore or ()),
        "road_colors": tuple(map(color, road_colors or ())),
        "ignore_colors": tuple(map(color, ignore_colors or ())),
    }
    with usage():
        settings: LabelSettings = override(LabelSettings(), given, "labels:")
        return settings
