"""The kernels as NumPy and OpenCV expressions: their definition, and used where none compile.

Each file holds the twins of the C file of the same name.
"""

from roadeval.kernels.plain.bits import count_bits, dilate, erode
from roadeval.kernels.plain.colours import look_up_colours, look_up_sum_min, mahalanobis
from roadeval.kernels.plain.compensation import ring_sums, run_sums, transfer
from roadeval.kernels.plain.geodesics import ASLANT, FAR, STRAIGHT, geodesics
from roadeval.kernels.plain.outcomes import add_outcomes, outcomes
from roadeval.kernels.plain.rows import (
    LABEL_BITS,
    filter_rows,
    label_rows,
    mask_rows,
)
from roadeval.kernels.plain.runs import components, fill_holes, keep_region, label_runs, paint
from roadeval.kernels.plain.trees import LEAVES, tree_sum

__all__ = [
    "ASLANT",
    "FAR",
    "LABEL_BITS",
    "LEAVES",
    "STRAIGHT",
    "add_outcomes",
    "components",
    "count_bits",
    "dilate",
    "erode",
    "fill_holes",
    "filter_rows",
    "geodesics",
    "keep_region",
    "label_rows",
    "label_runs",
    "look_up_colours",
    "look_up_sum_min",
    "mahalanobis",
    "mask_rows",
    "outcomes",
    "paint",
    "ring_sums",
    "run_sums",
    "transfer",
    "tree_sum",
]
