"""The statistics: differences with intervals, within a drive and over drives, and corrections."""

from roadeval.evaluation.stats.autocorrelation import (
    CameraRates,
    Difference,
    benjamini_hochberg,
    holm,
    mean_distribution,
    within_drive,
)
from roadeval.evaluation.stats.drives import (
    DriveMean,
    group_means,
    over_drives,
    sign_flip_interval,
    sign_flip_p,
    strata,
)
from roadeval.evaluation.stats.sampling import Estimate, draw_order, estimate
