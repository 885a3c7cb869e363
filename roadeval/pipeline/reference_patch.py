"""The reference patch: a trapezoid in front of the vehicle that is taken for road."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

from annotated_types import Interval

if TYPE_CHECKING:
    from roadeval.data import Mask

Share = Annotated[float, Interval(ge=0, le=1)]


@dataclass(frozen=True)
class ReferencePatch:
    """A trapezoid, symmetric about the image's middle; all as shares of height and width.

    top: First row, from the image's upper edge.
    bottom: Last row, above the vehicle's own bonnet.
    top_width: Width of the upper edge.
    bottom_width: Width of the lower edge.
    """

    top: Share = 0.75
    bottom: Share = 0.95
    top_width: Share = 0.2
    bottom_width: Share = 0.4

    def __post_init__(self) -> None:
        if self.top >= self.bottom:
            raise ValueError("top must lie above bottom (a smaller share of the height)")


@lru_cache(maxsize=16)
def patch_mask(height: int, width: int, patch: ReferencePatch) -> Mask:
    """Rasterise the patch as an ``(H, W)`` uint8 mask, read-only and shared between calls.

    A pixel belongs to it if its centre does; each row holds at least the middle.
    """
    import numpy as np

    top, bottom = (round(share * (height - 1)) for share in (patch.top, patch.bottom))
    share = np.linspace(patch.top_width, patch.bottom_width, bottom - top + 1)
    half = np.maximum(share * width / 2, 0.5)
    mask = np.zeros((height, width), np.uint8)
    mask[top : bottom + 1] = np.abs(np.arange(width) - (width - 1) / 2) <= half[:, None]
    mask.flags.writeable = False
    return mask
