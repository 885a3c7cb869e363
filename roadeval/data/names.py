"""Names of variants and stages, and those that are taken."""

from __future__ import annotations

import re
from typing import Final

CAMERA: Final = "camera"
FILTERED: Final = "filtered"
UNFILTERED: Final = "unfiltered"
"""The names of the two variants that come by default: with the chain's filters, and without."""
BASELINE: Final = "blind"
"""The variant name of the baseline that never looks at the image."""
FINAL_STAGE: Final = "post"
"""The stage whose mask is the pipeline's answer, and under which the baseline is filed."""

RESERVED: Final = frozenset(
    {
        *("blind", "camera", "counts", "facts", "frame", "metrics", "notes", "results"),
        *("roadeval", "state", "timing", "true_shadow", "truth"),
    }
)
"""Names that no variant may bear: the tables or the recording use them for something else."""

_PLAIN: Final = re.compile(r"[A-Za-z0-9_-]{1,200}")
"""No longer than the name of a file can be, with an ending."""


def is_plain(name: str) -> bool:
    """Return whether a name of a variant, stage or region is one that results can hold.

    It is a column's cell, a part of a path in the recording, and a word in figures and tables.
    """
    return _PLAIN.fullmatch(name) is not None
