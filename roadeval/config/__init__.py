"""Configurations: a run's and its variants', presets, and TOML both ways.

Names are imported when they are first used: a command that reads settings needs little else.
"""

from typing import TYPE_CHECKING

from roadeval.runtime.imports import on_demand

if TYPE_CHECKING:
    from roadeval.config.camera_file import read_camera
    from roadeval.config.run import (
        OF_A_LOG,
        RunConfig,
        config_toml,
        configure,
        load_config,
        log_config,
        run_toml,
    )
    from roadeval.config.settings import ExecutionSettings, FleetSettings, OutputSettings
    from roadeval.config.tables import ConfigError, in_file, override, read_tables
    from roadeval.config.variants import (
        AS_IT_IS,
        PRESETS,
        Variant,
        check_variant_name,
        network_variant,
        with_masks,
    )

if not TYPE_CHECKING:  # there every name is known
    __getattr__ = on_demand(__name__)
