"""The compiled kernels, by the names of their twins in `plain`; compiled when this is imported."""

from roadeval.kernels.bits import count_bits, grow
from roadeval.kernels.colours import look_up_colours, look_up_sum_min, mahalanobis
from roadeval.kernels.compensation import paint, ring_sums, run_sums, transfer
from roadeval.kernels.compiler import compile_ahead
from roadeval.kernels.rectified import rectified_sum
from roadeval.kernels.runs import components, fill_holes, keep_region, label_runs

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
    "paint",
    "rectified_sum",
    "ring_sums",
    "run_sums",
    "transfer",
]

for _name in __all__:
    # That one is compiled when it is called: how many features it sums is a part of its types.
    if _name != "rectified_sum":
        compile_ahead(globals()[_name])
