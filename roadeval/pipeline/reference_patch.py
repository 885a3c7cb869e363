"""The reference patch: a trapezoid in front of the vehicle that is taken to be road."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field, model_validator
from pydantic.dataclasses import dataclass as validated

from roadeval.data import Mask

Share = Annotated[float, Field(ge=0, le=1)]


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class ReferencePatch:
    """A trapezoid, symmetric about the image's middle; all as shares of height and width."""

    top: Share = 0.75
    """First row, from the image's upper edge."""
    bottom: Share = 0.95
    """Last row; it stays clear of the vehicle's own bonnet."""
    top_width: Share = 0.2
    """Width of the upper edge."""
    bottom_width: Share = 0.4
    """Width of the lower edge."""

    @model_validator(mode="after")
    def _upright(self) -> ReferencePatch:
        if self.top >= self.bottom:
            raise ValueError("top must lie above bottom (a smaller share of the height)")
        return self


@lru_cache(maxsize=16)
def patch_mask(height: int, width: int, patch: ReferencePatch) -> Mask:
    """Rasterise the patch as an ``(H, W)`` uint8 mask, read-only and shared between calls.

    A pixel belongs to it when its centre does; each row holds at least the middle.
    """
    top, bottom = (round(share * (height - 1)) for share in (patch.top, patch.bottom))
    share = np.linspace(patch.top_width, patch.bottom_width, bottom - top + 1)
    half = np.maximum(share * width / 2, 0.5)
    mask = np.zeros((height, width), np.uint8)
    mask[top : bottom + 1] = np.abs(np.arange(width) - (width - 1) / 2) <= half[:, None]
    mask.flags.writeable = False
    return mask
