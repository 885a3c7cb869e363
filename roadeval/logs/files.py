"""Finding the files of a log, and calling by its name what is no log."""

from __future__ import annotations

import re
from pathlib import Path

from roadeval.logs.errors import LogError
from roadeval.logs.records import MAGIC


def files_of(path: Path) -> list[Path]:
    """List the MCAP files of a log: the file itself, or a rosbag2 folder's in natural order.

    Raises
    ------
    LogError
        If there is none, or one is no MCAP file.
    """
    files = sorted(path.glob("*.mcap"), key=_natural) if path.is_dir() else [path]
    if not files:
        raise LogError(f"{path}: a folder without *.mcap files")
    for file in files:
        _check(file)
    return files


def _natural(path: Path) -> list[tuple[int, str]]:
    """Order by which ``drive_2`` comes before ``drive_10``."""
    parts = re.findall(r"(\d+)|(\D+)", path.name)
    return [(int(number or 0), text) for number, text in parts]


def _check(path: Path) -> None:
    try:
        with path.open("rb") as file:
            head = file.read(len(MAGIC))
    except OSError as error:
        raise LogError(f"{path}: {error.strerror or error}") from error
    if head != MAGIC:
        raise LogError(f"{path}: not an MCAP file")
