"""Textures of the ground, averaged along the road before they are sampled.

Seen from a car, a pixel far ahead covers metres of road lengthwise but centimetres across, so a
texture is kept at several resolutions along Z and at (nearly) one across.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from benchmarks.world.noise import Field


@dataclass(frozen=True, slots=True)
class GroundTexture:
    """A texture over offset (columns) and Z (rows), coarser and coarser along Z.

    Parameters
    ----------
    levels
        ``(rows / 2**k, columns)`` or ``(..., 3)`` float32, or uint8 for shares of 255.
    cell
        Side of a cell of the finest level, metres.
    left, start
        Offset and Z of the first cell's outer corner, metres.
    outside
        The value beyond the texture; None if it wraps around.
    """

    levels: tuple[Field, ...]
    cell: float
    left: float
    start: float
    outside: float | None

    @classmethod
    def averaged(
        cls, finest: Field, cell: float, left: float, start: float, outside: float | None = None
    ) -> GroundTexture:
        """Average ``finest`` along Z by 2, 4, 8 ... as long as 16 rows remain."""
        levels = [finest]
        while levels[-1].shape[0] >= 32:
            rows, columns = levels[-1].shape[:2]
            size = (columns, rows // 2)
            levels.append(cv2.resize(levels[-1], size, interpolation=cv2.INTER_AREA))
        return cls(tuple(levels), cell, left, start, outside)

    def sample(self, offset: Field, z: Field, length: Field) -> Field:
        """Sample at ``(h, w)`` points; each row averages over about ``length`` metres of Z.

        Parameters
        ----------
        offset, z
            ``(h, w)`` float32, metres.
        length
            ``(h,)`` float32, metres.
        """
        level = np.clip(np.log2(length / self.cell), 0, len(self.levels) - 1)
        column = (offset - self.left) / self.cell - 0.5
        row = (z - self.start) / self.cell
        border = cv2.BORDER_WRAP if self.outside is None else cv2.BORDER_CONSTANT
        sampled = np.zeros((*z.shape, *self.levels[0].shape[2:]), np.float32)
        for k, texture in enumerate(self.levels):
            weight = np.clip(1.0 - np.abs(level - k), 0.0, None).astype(np.float32)
            used = np.flatnonzero(weight)
            if used.size:
                band = slice(used[0], used[-1] + 1)
                patch = cv2.remap(
                    texture,
                    column[band],
                    row[band] * np.float32(0.5**k) - np.float32(0.5),
                    cv2.INTER_LINEAR,
                    borderMode=border,
                    borderValue=self.outside or 0.0,
                )
                sampled[band] += weight[band].reshape(-1, *[1] * (patch.ndim - 1)) * patch
        return sampled
