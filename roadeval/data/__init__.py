"""The types that are passed between the packages: frozen, typed, with no library but NumPy.

Images are ``(H, W, 3)`` uint8 RGB, masks ``(H, W)`` uint8 with 1 for road (or shadow) and 0
otherwise, or `Packed`. Times are integer nanoseconds since the Unix epoch, or whatever epoch the
log uses.
"""

from roadeval.data.counts import OUTCOMES, Change, Counts, Tally, Transition
from roadeval.data.frame import (
    IGNORE,
    NON_ROAD,
    ROAD,
    Frame,
    Histogram,
    Mask,
    Moment,
    Probability,
    Rgb,
    Role,
    Truth,
)
from roadeval.data.layer import (
    ERRORS,
    ROAD_CLASSES,
    TRUTH,
    LabelClass,
    Layer,
    LayerKind,
    LayerSpec,
    mask_spec,
)
from roadeval.data.names import (
    BASELINE,
    CAMERA,
    FILTERED,
    FINAL_STAGE,
    RESERVED,
    UNFILTERED,
    is_plain,
)
from roadeval.data.packed import Packed, TruthBits, everywhere, ones, pack, unpack
from roadeval.data.result import (
    FrameResult,
    Health,
    Output,
    StageResult,
    VariantLayout,
    VariantResult,
)
from roadeval.data.rows import Rows

__all__ = [
    "BASELINE",
    "CAMERA",
    "ERRORS",
    "FILTERED",
    "FINAL_STAGE",
    "IGNORE",
    "NON_ROAD",
    "OUTCOMES",
    "RESERVED",
    "ROAD",
    "ROAD_CLASSES",
    "TRUTH",
    "UNFILTERED",
    "Change",
    "Counts",
    "Frame",
    "FrameResult",
    "Health",
    "Histogram",
    "LabelClass",
    "Layer",
    "LayerKind",
    "LayerSpec",
    "Mask",
    "Moment",
    "Output",
    "Packed",
    "Probability",
    "Rgb",
    "Role",
    "Rows",
    "StageResult",
    "Tally",
    "Transition",
    "Truth",
    "TruthBits",
    "VariantLayout",
    "VariantResult",
    "everywhere",
    "is_plain",
    "mask_spec",
    "ones",
    "pack",
    "unpack",
]
