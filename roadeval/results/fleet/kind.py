"""What makes a folder a fleet's: told without the libraries that read one."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from roadeval.results.schema import OF_DRIVES

FLEET: Final = "fleet.json"
"""The file that makes a folder a fleet's; written last."""
RUN: Final = "run.toml"
METRICS: Final = "metrics.json"
JUNIT: Final = "junit.xml"
FILES: Final = (FLEET, RUN, METRICS, JUNIT, *(f"{table}.parquet" for table in OF_DRIVES))
"""The files of a fleet's folder."""


def is_fleet(path: str | Path) -> bool:
    """Return whether a path leads to a fleet's folder."""
    return (Path(path) / FLEET).is_file()
