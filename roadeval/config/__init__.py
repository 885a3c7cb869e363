"""Configurations: a run's and its variants', presets, and TOML both ways.

Names are imported when they are first used: a command that reads settings needs little else.
"""

from typing import TYPE_CHECKING, Final

from roadeval.runtime.on_demand import on_demand

if TYPE_CHECKING:
    from roadeval.config.drives import DriveSettings
    from roadeval.config.errors import ConfigError
    from roadeval.config.log import log_config
    from roadeval.config.names import check_variant_name
    from roadeval.config.networks import network_variant
    from roadeval.config.presets import PRESETS
    from roadeval.config.run import RunConfig, configure
    from roadeval.config.settings import ExecutionSettings, FleetSettings, OutputSettings
    from roadeval.config.toml import load_config, read_tables
    from roadeval.config.variants import Variant

__all__ = [
    "PRESETS",
    "ConfigError",
    "DriveSettings",
    "ExecutionSettings",
    "FleetSettings",
    "OutputSettings",
    "RunConfig",
    "Variant",
    "check_variant_name",
    "configure",
    "load_config",
    "log_config",
    "network_variant",
    "read_tables",
]

_MODULES: Final = {
    "PRESETS": "presets",
    "ConfigError": "errors",
    "DriveSettings": "drives",
    "ExecutionSettings": "settings",
    "FleetSettings": "settings",
    "OutputSettings": "settings",
    "RunConfig": "run",
    "Variant": "variants",
    "check_variant_name": "names",
    "configure": "run",
    "load_config": "toml",
    "log_config": "log",
    "network_variant": "networks",
    "read_tables": "toml",
}

if not TYPE_CHECKING:  # there every name is known
    __getattr__ = on_demand(__name__, _MODULES)
