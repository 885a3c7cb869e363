"""Which files are logs and which folders are rosbag2's, by their names, and their order."""

from __future__ import annotations

from pathlib import Path, PurePath
from typing import Any, Final

from roadeval.logs import natural

METADATA: Final = "metadata.yaml"
"""The file in which rosbag2 describes the files beside it."""
_BAG: Final = b"rosbag2_bagfile_information"
HEAD: Final = 4096
"""Bytes of that file in which its heading stands."""
_OF_THE_SYSTEM: Final = ("lost+found", "System Volume Information")
"""Folders at the top of a disk that nobody may read."""


def counts(name: str) -> bool:
    """Return whether a file or folder is looked at: it is not hidden, and is complete."""
    hidden = name.startswith(".") or name in _OF_THE_SYSTEM
    return not hidden and PurePath(name.lower()).suffixes[-2:-1] != [".partial"]


def is_log(name: str) -> bool:
    """Return whether a file that nobody named is a log."""
    return name.lower().endswith(".mcap") and counts(name)


def is_heading(head: bytes) -> bool:
    """Return whether a file begins as rosbag2's `METADATA` does."""
    return _BAG in head


def is_bag(folder: Path) -> bool:
    """Return whether a recorder of ROS 2 wrote a folder: its files are one drive."""
    try:
        with (folder / METADATA).open("rb") as file:
            return is_heading(file.read(HEAD))
    except OSError:
        return False


def in_order(path: PurePath) -> list[Any]:
    """Sort key by which ``monday/drive_2`` comes before ``monday/drive_10``."""
    return [(natural(Path(part)), part) for part in path.parts]
