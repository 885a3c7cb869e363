"""The types that the packages exchange: frozen, typed, with no library but NumPy.

Images are ``(H, W, 3)`` uint8 RGB, masks ``(H, W)`` uint8 with 1 for road (or shadow) and 0
otherwise, or `Packed`. Times are integer nanoseconds since the Unix epoch, or since the epoch of
the log.
"""

from roadeval.data.arrays import Packed, TruthBits, everywhere, ones, pack, unpack
from roadeval.data.calibration import Calibration, Mounting
from roadeval.data.frame import (
    IGNORE,
    NO_CLASS,
    NON_ROAD,
    ROAD,
    Classes,
    Frame,
    Histogram,
    Mask,
    Moment,
    Probability,
    Rgb,
    Role,
    Truth,
    TruthClass,
)
from roadeval.data.histogram import CERTAIN, CODES, best_code, histogram, wrong_above
from roadeval.data.layer import ERRORS, TRUTH, LabelClass, Layer, LayerKind, LayerSpec, mask_spec
from roadeval.data.result import (
    BASELINE,
    FILTERED,
    FINAL_STAGE,
    OUTCOMES,
    RESERVED,
    TUNED,
    UNFILTERED,
    Change,
    Contour,
    Counts,
    Doubt,
    FrameMetres,
    FrameResult,
    Health,
    Output,
    StageResult,
    Tally,
    Transition,
    VariantLayout,
    VariantResult,
    as_plain,
    as_tree,
    is_plain,
)
