"""The score of a drive: counts and rates frame by frame, summed up over frames and windows."""

from roadeval.evaluation.score.counts import (
    FourCounts,
    FrameCounts,
    GrowingCounts,
    Name,
    Window,
    count,
    cut,
    error_map,
    means,
    sum_up,
)
from roadeval.evaluation.score.edges import EdgesAndFlicker, boundary_f, edge_of
from roadeval.evaluation.score.effects import (
    BASES,
    CLAIMS,
    TESTED,
    Effect,
    corrected,
    drive_effects,
    evidence,
    final_stages,
)
from roadeval.evaluation.score.frame import (
    BlindPrior,
    CountsNotConservedError,
    check_conserved,
    judge,
)
from roadeval.evaluation.score.light import Light, light_of
from roadeval.evaluation.score.maps import HeatMap, Maps, changes
from roadeval.evaluation.score.rows import (
    FILTER,
    by_region,
    causes,
    counts_of,
    each_window,
    finals,
    mask_counts,
    merged,
    most_changed,
    overlap,
    pairs,
    perfect_stages,
    region_totals,
    scene_ns,
    stages_of,
    totals,
    windows,
    worst,
)
from roadeval.evaluation.score.scoreboard import DriveSums, Scoreboard
from roadeval.evaluation.score.thresholds import (
    BINS,
    CODES,
    LEVELS,
    Curves,
    Thresholds,
    at_levels,
    calibration,
    calibration_error,
    histogram,
)
