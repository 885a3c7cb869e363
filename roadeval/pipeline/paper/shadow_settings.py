"""Settings of phase 2, the shadow filter (section 3.2)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as validated


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class ShadowSettings:
    """Settings of the shadow filter."""

    threshold: Literal["otsu", "printed"] = "otsu"
    """``otsu``: the between-class variance of Otsu (1979); ``printed``: Eq. 7 with the definitions
    printed beside it, which lands at the edge of the histogram."""
    inclusive: bool = False
    """Whether the threshold's own code is shadow, as printed in Eq. 8. Otsu's upper class begins
    above it."""
    connectivity: Literal[4, 8] = 8
    """Neighbours that make one component (Eq. 9): 8 or 4."""
    ring_width: Annotated[int, Field(ge=1, le=16)] = 1
    """Number of 3x3 dilations that make a buffer ring (Eq. 10), at most 16: the work grows with its
    square."""
    min_area: Annotated[int, Field(ge=1)] = 1
    """Components of fewer pixels are left as they are."""
    max_gain: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    """Upper bound of the contrast gain of Eq. 11; none as printed. Gains above 3 are common."""
    statistic: Literal["deviation", "printed"] = "deviation"
    """``deviation``: ``mu_ring + (I - mu) * sigma_ring / sigma``, which gives the component its
    ring's mean and standard deviation; ``printed``: Eq. 11 literally, variances and inverted."""
    colour_space: Literal["rgb", "hsi"] = "rgb"
    """Where the compensation happens: ``rgb``, or ``hsi`` (S and V of Eq. 3-5, hue kept, converted
    back as step 5 of section 4.2 says)."""
