"""The statistics: differences with intervals, within a drive and over drives, and corrections."""

from roadeval.evaluation.stats.difference import (
    Difference,
    benjamini_hochberg,
    holm,
    within_drive,
)
from roadeval.evaluation.stats.drives import (
    STUDENT_FROM,
    DriveMean,
    Stratum,
    group_means,
    over_drives,
    strata,
)

__all__ = [
    "STUDENT_FROM",
    "Difference",
    "DriveMean",
    "Stratum",
    "benjamini_hochberg",
    "group_means",
    "holm",
    "over_drives",
    "strata",
    "within_drive",
]
