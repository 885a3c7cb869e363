"""Sets of pixels that are counted apart, so that a table can say where the errors are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache

import numpy as np

from roadeval.data import NON_ROAD, ROAD, Frame, Mask, Truth, VariantResult


def of_frame(
    frame: Frame, variants: Iterable[VariantResult], *, boundary_width: int, bands: int
) -> dict[str, Mask]:
    """Collect every region of a labelled frame, each ``(H, W)`` uint8, 1 inside.

    ``true_shadow`` is there where the log has that truth. The filter's regions are there where a
    variant has the filter.
    """
    assert frame.truth is not None
    found = detected(variants)
    if frame.shadow_truth is not None:
        found["true_shadow"] = (frame.shadow_truth == 1).view(np.uint8)
    found["boundary"] = boundary(frame.truth, boundary_width)
    found["interior"] = found["boundary"] ^ np.uint8(1)
    return found | dict(row_bands(frame.truth.shape[:2], bands))


def detected(variants: Iterable[VariantResult]) -> dict[str, Mask]:
    """Collect the regions that stages found (``shadow``, ``shadow_edge``, ``lit``).

    The first variant that has a region of a name gives it to all: variants are compared on the
    same pixels.
    """
    found: dict[str, Mask] = {}
    for variant in variants:
        for result in variant.stages:
            for name, mask in result.regions.items():
                found.setdefault(name, mask)
    return found


def boundary(truth: Truth, width: int) -> Mask:
    """Mark the pixels within ``width`` of the edge between road and non-road.

    A pixel belongs to it if the square of side ``2 * width + 1`` around it holds both road and
    non-road of the truth. An ignored pixel is neither, so where road meets ignored pixels there
    is no edge.

    Parameters
    ----------
    truth
        ``(H, W)`` uint8: 0, 1, or 255 for ignored.
    width
        Pixels on either side of the edge, in chessboard distance.
    """
    import cv2

    square = np.ones((2 * width + 1, 2 * width + 1), np.uint8)
    near_road = cv2.dilate((truth == ROAD).view(np.uint8), square)
    near_other = cv2.dilate((truth == NON_ROAD).view(np.uint8), square)
    both: Mask = near_road & near_other
    return both


@lru_cache(maxsize=8)
def row_bands(shape: tuple[int, int], bands: int) -> Mapping[str, Mask]:
    """Cut the image's rows into ``bands`` stripes of equal height to within a row.

    Parameters
    ----------
    shape
        Height and width in pixels.
    bands
        Number of stripes; ``band_0`` is the topmost.
    """
    stripe = np.arange(shape[0]) * bands // shape[0]
    return {
        f"band_{index}": np.repeat((stripe == index).astype(np.uint8)[:, None], shape[1], axis=1)
        for index in range(bands)
    }
