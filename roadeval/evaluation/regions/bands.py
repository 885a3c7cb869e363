"""Equal stripes of image rows, ``band_0`` at the top: how far away an error lies."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache

import numpy as np

from roadeval.data.arrays import Bits
from roadeval.data.packed import everywhere
from roadeval.evaluation.region import LabelledFrame, RegionFamily


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


def _bands(labelled: LabelledFrame) -> Mapping[str, Bits]:
    return row_bands(labelled.truth.shape, labelled.settings.bands)


def _titles(names: Collection[str], height: int) -> dict[str, str]:
    bands = [name for name in names if name.startswith("band_")]
    titles = {}
    for place, name in enumerate(bands):
        first, after = (-(-height * edge // len(bands)) for edge in (place, place + 1))
        rows = (
            f"image rows {first}\N{EN DASH}{after - 1}" if height else f"image rows, band {place}"
        )
        titles[name] = rows + {0: ", the top", len(bands) - 1: ", the bottom"}.get(place, "")
    return titles


REGION = RegionFamily(order=40, found=_bands, titles=_titles, whole=True)
