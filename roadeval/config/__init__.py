"""Configurations: a run's and its variants', presets, and TOML both ways.

Names are imported when they are first used: a command that reads settings needs little else.
"""

from typing import TYPE_CHECKING, Final

from roadeval.runtime.on_demand import on_demand

if TYPE_CHECKING:
    from roadeval.config.document import documented, run_toml
    from roadeval.config.run import (
        OF_A_LOG,
        DriveSettings,
        RunConfig,
        configure,
        load_config,
        log_config,
    )
    from roadeval.config.settings import ExecutionSettings, FleetSettings, OutputSettings
    from roadeval.config.tables import ConfigError, read_tables
    from roadeval.config.variants import (
        PRESETS,
        Variant,
        check_variant_name,
        network_variant,
        with_masks,
    )

__all__ = [
    "OF_A_LOG",
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
    "documented",
    "load_config",
    "log_config",
    "network_variant",
    "read_tables",
    "run_toml",
    "with_masks",
]

_MODULES: Final = {
    "OF_A_LOG": "run",
    "PRESETS": "variants",
    "ConfigError": "tables",
    "DriveSettings": "run",
    "ExecutionSettings": "settings",
    "FleetSettings": "settings",
    "OutputSettings": "settings",
    "RunConfig": "run",
    "Variant": "variants",
    "check_variant_name": "variants",
    "configure": "run",
    "documented": "document",
    "load_config": "run",
    "log_config": "run",
    "network_variant": "variants",
    "read_tables": "tables",
    "run_toml": "document",
    "with_masks": "variants",
}

if not TYPE_CHECKING:  # there every name is known
    __getattr__ = on_demand(__name__, _MODULES)
