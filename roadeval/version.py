"""The version of the package, in a separate module so that `--version` imports nothing else."""

from typing import Final

VERSION: Final = "0.2.0"
REPOSITORY: Final = "https://github.com/roadeval/roadeval"
"""The project's address, which ``pyproject.toml`` states as well."""
