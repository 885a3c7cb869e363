"""Many drives: how they are found, where their files are, and who replays them.

Names are imported when they are first used.
"""

from typing import TYPE_CHECKING

from roadeval.runtime.imports import on_demand

if TYPE_CHECKING:
    from roadeval.fleet.drives import DriveEntry, FleetError, find_drives, shown
    from roadeval.fleet.remote import readable, stamp

if not TYPE_CHECKING:  # there every name is known
    __getattr__ = on_demand(__name__)
