"""The statistics of a fleet: many drives judged together, the drive or its group as the unit."""

from roadeval.evaluation.corrections import benjamini_hochberg
from roadeval.evaluation.drives.across import AcrossDrives, Method, NoInterval, across_drives
from roadeval.evaluation.drives.effect import DriveEffect
from roadeval.evaluation.drives.settings import AcrossSettings
from roadeval.evaluation.drives.strata import Stratum, Third, strata

__all__ = [
    "AcrossDrives",
    "AcrossSettings",
    "DriveEffect",
    "Method",
    "NoInterval",
    "Stratum",
    "Third",
    "across_drives",
    "benjamini_hochberg",
    "strata",
]
