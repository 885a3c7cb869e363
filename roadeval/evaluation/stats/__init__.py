"""The statistics: differences with intervals, within a drive and over drives, and corrections."""

from roadeval.evaluation.stats.autocorrelation import mean_distribution
from roadeval.evaluation.stats.difference import (
    CameraRates,
    Difference,
    benjamini_hochberg,
    group_means,
    holm,
    interval,
    over_drives,
    sign_flip_interval,
    sign_flip_p,
    strata,
    within_drive,
)
from roadeval.evaluation.stats.sampling import Estimate, draw_order, estimate
