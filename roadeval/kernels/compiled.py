"""The compiled kernels, by the names of their twins in `plain`."""

from roadeval.kernels.bits import area, count_bits, grow
from roadeval.kernels.colours import (
    add_outcomes,
    look_up_channels,
    look_up_colours,
    look_up_levels,
    look_up_sum_min,
    mahalanobis,
    outcomes,
)
from roadeval.kernels.machine import climb, rectified_sum
from roadeval.kernels.runs import components, fill_holes, keep_region, label_runs
from roadeval.kernels.shades import paint, ring_sums, run_sums, transfer

__all__ = [
    "add_outcomes",
    "area",
    "climb",
    "components",
    "count_bits",
    "fill_holes",
    "grow",
    "keep_region",
    "label_runs",
    "look_up_channels",
    "look_up_colours",
    "look_up_levels",
    "look_up_sum_min",
    "mahalanobis",
    "outcomes",
    "paint",
    "rectified_sum",
    "ring_sums",
    "run_sums",
    "transfer",
]
