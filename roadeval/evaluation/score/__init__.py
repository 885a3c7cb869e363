"""The score of a drive: counts and rates frame by frame, summed up over frames and windows."""

from roadeval.evaluation.score.counts import (
    Camera,
    EdgesAndFlicker,
    FourCounts,
    FrameCounts,
    GrowingCounts,
    Name,
    Total,
    contours,
    count,
    edge_of,
    error_map,
    final_stages,
    means,
    over_cameras,
    sum_up,
    windows,
)
from roadeval.evaluation.score.fit import LAST_LAG, SPOTS, TRUTH, Finding, FitCheck, Misfit
from roadeval.evaluation.score.frame import (
    BlindPrior,
    judge,
)
from roadeval.evaluation.score.metres import differences_of
from roadeval.evaluation.score.rows import (
    FILTER,
    by_region,
    camera_masks,
    causes,
    counts_of,
    finals,
    merged,
    most_changed,
    overlap,
    pairs,
    perfect_stages,
    region_totals,
    scene_ns,
    worst,
)
from roadeval.evaluation.score.scoreboard import (
    BASES,
    CLAIMS,
    TESTED,
    Effect,
    Scoreboard,
    corrected,
    drive_effects,
    evidence,
    totals,
    within,
)
from roadeval.evaluation.score.thresholds import (
    LEVELS,
    Curves,
    HeatMap,
    Thresholds,
    at_levels,
    calibration,
    changes,
)
from roadeval.evaluation.score.unlabelled import SIGNS, Unlabelled, chosen, doubts_of, sign_of
