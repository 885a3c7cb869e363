"""Many drives: which there are, and where their bytes lie. Nothing here replays one.

Names are imported when they are first used.
"""

from typing import TYPE_CHECKING, Final

from roadeval.runtime.on_demand import on_demand

if TYPE_CHECKING:
    from roadeval.fleet.entry import DriveEntry
    from roadeval.fleet.errors import FleetError
    from roadeval.fleet.remote import staged, stamp
    from roadeval.fleet.sources import find_drives
    from roadeval.fleet.urls import shown

__all__ = ["DriveEntry", "FleetError", "find_drives", "shown", "staged", "stamp"]

_MODULES: Final = {
    "DriveEntry": "entry",
    "FleetError": "errors",
    "find_drives": "sources",
    "shown": "urls",
    "staged": "remote",
    "stamp": "remote",
}

if not TYPE_CHECKING:  # there every name is known
    __getattr__ = on_demand(__name__, _MODULES)
