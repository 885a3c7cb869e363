"""The compiled kernels, by the names of their twins in `plain`."""

from roadeval.kernels.colours import (
    look_up_colours,
    look_up_sum_min,
    mahalanobis,
    rectified_sum,
    ring_sums,
    run_sums,
    transfer,
)
from roadeval.kernels.shapes import (
    components,
    count_bits,
    fill_holes,
    grow,
    keep_region,
    label_runs,
)

__all__ = [
    "components",
    "count_bits",
    "fill_holes",
    "grow",
    "keep_region",
    "label_runs",
    "look_up_colours",
    "look_up_sum_min",
    "mahalanobis",
    "rectified_sum",
    "ring_sums",
    "run_sums",
    "transfer",
]
