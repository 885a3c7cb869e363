"""The compiled kernels, by the names of their twins in `plain`."""

from roadeval.kernels.colours import (
    add_outcomes,
    look_up_colours,
    look_up_sum_min,
    mahalanobis,
    outcomes,
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
    "add_outcomes",
    "components",
    "count_bits",
    "fill_holes",
    "grow",
    "keep_region",
    "label_runs",
    "look_up_colours",
    "look_up_sum_min",
    "mahalanobis",
    "outcomes",
    "rectified_sum",
    "ring_sums",
    "run_sums",
    "transfer",
]
