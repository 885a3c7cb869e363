"""True shadow, where the log has that truth."""

from __future__ import annotations

from roadeval.data.arrays import Bits
from roadeval.data.packed import Packed
from roadeval.evaluation.region import LabelledFrame, Region


def true_shadow(labelled: LabelledFrame) -> Bits | None:
    """Return the truly shadowed pixels, ``(H, words)``; None without a truth of shadow."""
    if labelled.frame.shadow_truth is None:
        return None
    bits: Bits = labelled.truth.bits_of([Packed.of(labelled.frame.shadow_truth == 1)])[0]
    return bits


REGION = Region("true_shadow", "inside true shadow", order=20, find=true_shadow)
