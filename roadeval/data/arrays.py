"""The kinds of arrays that the kernels take and return, and the outcomes that some hold."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
"""``(H, W, 3)`` RGB."""
Plane = npt.NDArray[np.uint8]
"""``(H, W)``: a channel, codes of any kind, or a mask, nonzero inside."""
Planes = tuple[Plane, Plane, Plane]
"""Red, green and blue."""
CodeTable = npt.NDArray[np.uint8]
"""``(n, m)``: a code for each pair of numbers."""
Labels = npt.NDArray[np.int32]
"""``(H, W)``: a component's number at each of its pixels, 0 outside."""
Runs = npt.NDArray[np.int32]
"""``(n, 4)``: row, first column, column after the last, and label, row after row and from left to
right in each."""
Costs = npt.NDArray[np.uint16]
"""``(H, W)``: what a step of length 1 costs at each pixel."""
Distances = npt.NDArray[np.int32]
"""``(H, W)``: what the cheapest path to each pixel costs."""
Indices = npt.NDArray[np.int32]
"""``(n, m)``: the place of each in a list."""
Masks = npt.NDArray[np.uint32]
"""``(n, m)``: a bit for each of something, 32 of each."""
Flags = npt.NDArray[np.bool_]
"""``(n,)``: whether something holds of each of something."""
Sums = npt.NDArray[np.int64]
"""``(n, ...)``: whole numbers by label or kind."""
Values = npt.NDArray[np.float32]
Floats = npt.NDArray[np.float64]
"""Of any shape."""
Vector = npt.NDArray[np.float64]
"""``(n,)``."""
Matrix = npt.NDArray[np.float64]
"""``(n, m)``."""
Bits = npt.NDArray[np.uint64]
"""``(H, words)`` of an ``(H, W)`` mask, C-contiguous, 64 pixels a word, the leftmost in the lowest
bit; those beyond the width are 0. ``(K, H, words)`` of K masks."""
Words = npt.NDArray[np.uint64]
"""``(n,)``: a bit for each of something, 64 a word."""
Reach = npt.NDArray[np.int64]
"""A structuring element that is symmetric in both directions, ``(r + 1,)``: how many pixels it
extends to either side in its own row and in each of the r rows above and below, never more in a row
further away."""

TN: Final = 0
TP: Final = 1
FP: Final = 2
FN: Final = 3
IGNORED: Final = 4
"""How a pixel came out, where a plane holds that of each. These stand in recordings, and do not
change."""
