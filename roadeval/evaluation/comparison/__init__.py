"""The comparison of results: what changed on the same frames, and the limits that it must keep."""

from roadeval.evaluation.comparison.compare import (
    FALSE,
    Change,
    ComparedResult,
    Comparison,
    ComparisonError,
    DriveChange,
    RegionChange,
    compare,
    variants_as_sides,
)
from roadeval.evaluation.comparison.conditions import (
    Condition,
    ConditionError,
    Judgement,
    judge,
)
from roadeval.evaluation.comparison.pairing import (
    MovedFrame,
    Part,
    Side,
    common_masks,
    disagreements,
    match_drives,
    matched,
    one_drive,
    truth_differs,
)
