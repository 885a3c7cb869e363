"""What makes a folder a fleet's: told without the libraries that read one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from roadeval.errors import RoadevalError
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


def are_fleets(results: Sequence[str | Path]) -> bool:
    """Return whether what is to be compared are two fleets, and no single results.

    Raises
    ------
    RoadevalError
        If a fleet is to be compared with something else.
    """
    fleets = [path for path in results if is_fleet(path)]
    if not fleets:
        return False
    if others := [path for path in results if path not in fleets]:
        raise RoadevalError(
            f"{fleets[0]} is a fleet and {others[0]} is not; compare two fleets, or the result "
            f"of one drive with that in {Path(fleets[0]) / 'results'}"
        )
    if len(fleets) != 2:
        raise RoadevalError(
            f"{fleets[0]}: two fleets can be compared, not {len(fleets)}; the variants of one "
            "stand side by side in its report"
        )
    return True
