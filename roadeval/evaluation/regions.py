"""Sets of pixels that are counted apart, so that a table can say where the errors are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache

import numpy as np

from roadeval.data import Frame, TruthBits, VariantResult
from roadeval.data.arrays import Bits
from roadeval.data.packed import Packed, everywhere
from roadeval.evaluation.bits import grow, square


def of_frame(
    frame: Frame,
    truth: TruthBits,
    variants: Iterable[VariantResult],
    *,
    boundary_width: int,
    bands: int,
) -> dict[str, Bits]:
    """Collect every region of a labelled frame, ``(H, words)`` each.

    ``true_shadow`` is there where the log has that truth. The filter's regions are there where a
    variant has the filter.
    """
    masks = detected(variants)
    if frame.shadow_truth is not None:
        masks["true_shadow"] = Packed.of(frame.shadow_truth == 1)
    found = dict(zip(masks, truth.bits_of(masks.values()), strict=True))
    found["boundary"] = boundary(truth, boundary_width)
    found["interior"] = found["boundary"] ^ everywhere(truth.shape)
    return found | dict(row_bands(truth.shape, bands))


def detected(variants: Iterable[VariantResult]) -> dict[str, Packed]:
    """Collect the regions that stages found (``shadow``, ``shadow_edge``, ``lit``).

    The first variant that has a region of a name gives it to all: variants are compared on the
    same pixels.
    """
    found: dict[str, Packed] = {}
    for variant in variants:
        for result in variant.stages:
            for name, mask in result.output.regions.items():
                found.setdefault(name, mask)
    return found


def boundary(truth: TruthBits, width: int) -> Bits:
    """Mark the pixels within ``width`` of the edge between road and non-road, ``(H, words)``.

    A pixel belongs to it if the square of side ``2 * width + 1`` around it holds both road and
    non-road of the truth. An ignored pixel is neither, so where road meets ignored pixels there
    is no edge. ``width`` is in pixels on either side, in chessboard distance.
    """
    element = square(width)
    return grow(truth.road, element, truth) & grow(truth.other, element, truth)


@lru_cache(maxsize=8)
def row_bands(shape: tuple[int, int], bands: int) -> Mapping[str, Bits]:
    """Cut an image's rows into stripes of equal height to within a row, ``(H, words)`` each.

    Parameters
    ----------
    shape
        Height and width in pixels.
    bands
        Number of stripes; ``band_0`` is the topmost.
    """
    stripe = np.arange(shape[0]) * bands // shape[0]
    whole = everywhere(shape)
    return {
        f"band_{index}": np.where((stripe == index)[:, None], whole, np.uint64(0))
        for index in range(bands)
    }
