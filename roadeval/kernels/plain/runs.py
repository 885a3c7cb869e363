"""Connected components of a mask, as stretches of rows (Eq. 9)."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import Bits, Labels, Plane, Runs
from roadeval.data.packed import pack, unpack


def components(bits: Bits, width: int, connectivity: int) -> tuple[Runs, int]:
    """Label the connected components of a mask (Eq. 9).

    Parameters
    ----------
    bits, width
        The mask, see `roadeval.data.packed`.
    connectivity
        8, or 4 where pixels that touch by a corner are not connected.

    Returns
    -------
    runs, count
        ``(n, 4)`` int32: row, first column, column after the last, and label of each of their
        rows' stretches, row after row and from left to right; and how many components there are.
        Labels count from 1, in the order of the components' first pixels.
    """
    count, found = cv2.connectedComponents(unpack(bits, width), connectivity=connectivity)
    # The library numbers them by blocks of rows.
    seen, first = np.unique(found, return_index=True)
    order = seen[seen > 0][np.argsort(first[seen > 0])]
    number = np.zeros(count, np.int32)
    number[order] = np.arange(1, count)
    return label_runs(number[found]), count - 1


def paint(runs: Runs, height: int, width: int) -> Labels:
    """Return the ``(height, width)`` int32 image of `components`' labels, 0 outside."""
    labels = np.zeros((height, width), np.int32)
    y, x, label = run_pixels(runs)
    labels[y, x] = label
    return labels


def label_runs(labels: Labels) -> Runs:
    """Return the rows' stretches of equal labels of an ``(H, W)`` int32 image, see `components`."""
    begins = np.ones((labels.shape[0], labels.shape[1] + 1), np.bool_)
    begins[:, 1:-1] = labels[:, 1:] != labels[:, :-1]
    y, x = np.nonzero(begins)
    runs = np.stack([y[:-1], x[:-1], x[1:]], axis=1)[y[:-1] == y[1:]]
    label = labels[runs[:, 0], runs[:, 1]]
    found: Runs = np.column_stack([runs, label])[label > 0].astype(np.int32)
    return found


def run_pixels(runs: Runs) -> tuple[npt.NDArray[np.int64], ...]:
    """Row, column and label of every pixel of some runs, ``(n,)`` each."""
    y, start, end, label = runs.T.astype(np.int64)
    length = end - start
    first = np.repeat(start - np.cumsum(length) + length, length)
    return np.repeat(y, length), first + np.arange(len(first)), np.repeat(label, length)


def keep_region(bits: Bits, width: int, patch: Plane) -> Bits:
    """Keep one 8-connected component of a mask; an empty one stays empty.

    The one with most pixels where ``patch``, ``(H, W)`` or empty, is nonzero; the largest where
    none has any there. Of equals the first from the top.
    """
    count, labels = cv2.connectedComponents(unpack(bits, width))
    if count <= 1:
        return bits.copy()
    votes = np.bincount(labels.ravel(), minlength=count)[1:]
    if patch.size:
        inside = np.bincount(labels[patch > 0], minlength=count)[1:]
        votes = inside if inside.any() else votes
    best = np.flatnonzero(votes == votes.max()) + 1
    # The library numbers components by blocks of rows: of equals, the first pixel decides.
    first = best[0] if len(best) == 1 else labels[np.isin(labels, best)][0]
    return pack(labels == first)


def fill_holes(bits: Bits, width: int) -> Bits:
    """Fill what a mask encloses.

    A hole is a 4-connected set of zeros that does not reach the outside of the image.
    """
    outside = np.pad(unpack(bits, width), 1)
    cv2.floodFill(outside, None, (0, 0), 2, flags=4)
    return pack(outside[1:-1, 1:-1] != 2)
