"""The reference patch: a trapezoid in front of the vehicle that is taken to be road."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated

import cv2
import numpy as np
from pydantic import ConfigDict, Field, model_validator
from pydantic.dataclasses import dataclass as validated

from roadeval.data import Mask

Share = Annotated[float, Field(ge=0, le=1)]


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class ReferencePatch:
    """A trapezoid, symmetric about the image's middle; all as shares of height and width.

    Parameters
    ----------
    top, bottom
        Rows from the image's upper edge. The bottom stays clear of the vehicle's own bonnet.
    top_width, bottom_width
        Widths of the upper and of the lower edge.
    """

    top: Share = 0.75
    bottom: Share = 0.95
    top_width: Share = 0.2
    bottom_width: Share = 0.4

    @model_validator(mode="after")
    def _upright(self) -> ReferencePatch:
        if self.top >= self.bottom:
            raise ValueError("top must lie above bottom (a smaller share of the height)")
        return self


@lru_cache(maxsize=16)
def patch_mask(height: int, width: int, patch: ReferencePatch) -> Mask:
    """Rasterise the patch as an ``(H, W)`` uint8 mask, read-only and shared between calls."""
    middle = (width - 1) / 2

    def edge(row: float, share: float) -> list[tuple[float, float]]:
        y, half = row * (height - 1), share * width / 2
        return [(middle - half, y), (middle + half, y)]

    left_top, right_top = edge(patch.top, patch.top_width)
    left_bottom, right_bottom = edge(patch.bottom, patch.bottom_width)
    corners = np.rint([left_top, right_top, right_bottom, left_bottom]).astype(np.int32)
    mask = np.zeros((height, width), np.uint8)
    cv2.fillConvexPoly(mask, corners, 1)
    mask.flags.writeable = False
    return mask
