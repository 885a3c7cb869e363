"""Rows of a PNG file."""

from __future__ import annotations

import numpy as np

from roadeval.data.arrays import Plane


def unfilter(lines: Plane, step: int) -> Plane:
    """Add to each byte of a PNG file's rows what the filter of its row has taken from it [1]_.

    Parameters
    ----------
    lines
        ``(H, 1 + B)`` uint8: each row's filter, 0 to 4, and its bytes.
    step
        Bytes from a pixel to the next.

    Returns
    -------
    numpy.ndarray
        ``(H, B)`` uint8. The sums are taken modulo 256; beyond the image all is 0.

    References
    ----------
    .. [1] "Portable Network Graphics (PNG) Specification (Third Edition)", W3C, 2025, section 9.
    """
    height, size = lines.shape
    # With what is above the image, and to the left of it.
    rows = np.zeros((height + 1, size - 1 + step), np.uint8)
    for above, row, (kind, *line) in zip(rows, rows[1:], lines.tolist(), strict=False):
        seen, found = above.tolist(), [0] * step
        for place, byte in enumerate(line):
            left, over, corner = found[place], seen[place + step], seen[place]
            nearest = min((left, over, corner), key=lambda value: abs(left + over - corner - value))
            taken = (0, left, over, (left + over) // 2, nearest)[kind]
            found.append((byte + taken) % 256)
        row[:] = found
    return rows[1:, step:]
