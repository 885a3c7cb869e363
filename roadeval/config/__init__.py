"""Configurations: a run's and its variants', presets, and TOML both ways."""

from roadeval.config.drives import DriveSettings
from roadeval.config.errors import ConfigError
from roadeval.config.presets import PRESETS
from roadeval.config.run import RunConfig, configure
from roadeval.config.settings import ExecutionSettings, OutputSettings
from roadeval.config.toml import load_config, read_tables
from roadeval.config.variants import Variant, check_variant_name

__all__ = [
    "PRESETS",
    "ConfigError",
    "DriveSettings",
    "ExecutionSettings",
    "OutputSettings",
    "RunConfig",
    "Variant",
    "check_variant_name",
    "configure",
    "load_config",
    "read_tables",
]
