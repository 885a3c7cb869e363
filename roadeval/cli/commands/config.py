"""``roadeval config``: the effective configuration, to read and to edit."""

from __future__ import annotations

from roadeval.cli import arguments, console
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import OptionValues, takes


@takes(
    *("preset", "config", "variants", "nets", "masks", "cameras"),
    *("output", "training", "truth", "topics", "labels", "frames", "run"),
)
def config(*, options: OptionValues) -> int:
    """Print the whole effective configuration as TOML.

        roadeval config --preset robust > robust.toml

    Each setting comes with its meaning and range. The file can be edited and given to --config;
    editors complete it by the schema in its first line.
    """
    settings = arguments.configuration(options)
    from roadeval.config.run import config_toml
    from roadeval.version import REPOSITORY, VERSION

    console.emit(f"#:schema {REPOSITORY}/raw/v{VERSION}/docs/schemas/run.schema.json")
    console.emit(config_toml(settings).rstrip())
    return ExitCode.DONE
