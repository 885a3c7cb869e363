"""Rows of a PNG file.

References
----------
"Portable Network Graphics (PNG) Specification (Third Edition)", W3C, 2025, section 9.
"""

from __future__ import annotations

import numpy as np

from roadeval.data.arrays import Plane


def filter_rows(rows: Plane, step: int, kind: int) -> Plane:
    """Subtract from each byte of an image's rows what a filter takes from it.

    Parameters
    ----------
    rows
        ``(H, B)`` uint8.
    step
        Bytes from a pixel to the next.
    kind
        1 takes the byte to the left, 2 the byte above, 3 the mean of both, rounded down.

    Returns
    -------
    numpy.ndarray
        ``(H, 1 + B)`` uint8, each row after its filter's number. The differences are taken modulo
        256; beyond the image all is 0.
    """
    left, above = np.zeros_like(rows), np.zeros_like(rows)
    left[:, step:], above[1:] = rows[:, :-step], rows[:-1]
    # (left + above) // 2 without a ninth bit.
    mean = (left & above) + ((left ^ above) >> 1)
    taken = (left, above, mean)[kind - 1]
    return np.insert(rows - taken, 0, np.uint8(kind), axis=1)


def unfilter_rows(lines: Plane, step: int) -> Plane:
    """Add to each byte of a PNG file's rows what the filter of its row has taken from it.

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
