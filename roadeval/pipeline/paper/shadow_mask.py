"""Which pixels are shadow (section 3.2, Eq. 6-8): NDI, Otsu's threshold, the mask."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Mask
from roadeval.data.arrays import Floats

Codes = npt.NDArray[np.uint8]


def ndi(saturation: Floats, value: Floats) -> Floats:
    """Compute the normalised difference index ``(S - V) / (S + V)`` in -1..1 (Eq. 6, section 3.2).

    The printed ``S - V / S - V`` lacks its brackets and a sign. ``S + V`` is 0 for pure black
    alone, which is -1 like every other grey, so that a rectified image's border is no shadow.
    """
    total = saturation + value
    return np.where(total > 0, (saturation - value) / np.where(total > 0, total, 1.0), -1.0)


def ndi_code(index: Floats) -> Codes:
    """Quantise NDI in -1..1 to the codes 0..255, ``rint((NDI + 1) * 127.5)``, uint8."""
    return np.rint((index + 1.0) * 127.5).astype(np.uint8)


def _ndi_codes() -> Codes:
    total = np.arange(3 * 255 + 1, dtype=np.float64)[:, None]
    least = np.minimum(np.arange(256, dtype=np.float64)[None, :], np.floor(total / 3))
    # NDI stays the same when S and V grow alike: times 765 (R + G + B) both are whole numbers,
    # and a code that lies halfway, as (R + G + B, min) = (85, 0) does, is rounded as one.
    return ndi_code(ndi(3 * 255 * (total - 3.0 * least), total**2))


NDI_CODES: Final = _ndi_codes()
"""``(766, 256)`` uint8: the code of Eq. 6 by ``R + G + B`` and ``min(R, G, B)``, on which alone
S, V and so NDI depend."""


_LEVELS: Final = np.arange(256)
"""j of Eq. 7."""


def otsu_threshold(histogram: npt.NDArray[np.int64]) -> int | None:
    """Return Otsu's threshold of a ``(256,)`` histogram (Eq. 7 as its source means it).

    The lowest T that maximises ``(mu_T w(T) - mu(T))^2 / (w(T) (1 - w(T)))``, with the weight
    ``w(T)`` and the first moment ``mu(T) = sum_{j<=T} j p_j`` of the lower class. The printed
    text defines ``mu(T)`` as the upper class's weight. None with a single occupied code.
    """
    lower, moment = histogram.cumsum(), (histogram * _LEVELS).cumsum()
    total = lower[-1]
    return _first_maximum(moment[-1] * lower - moment * total, lower * (total - lower))


def printed_threshold(histogram: npt.NDArray[np.int64]) -> int | None:
    """Return Eq. 7's threshold with the definitions printed beside it: ``mu(T) = sum_{j>T} p_j``.

    The lowest T that maximises ``(mu_T w(T) - mu(T))^2 / (w(T) mu(T))``, where it is defined.
    None with a single occupied code.
    """
    lower, mean = histogram.cumsum(), (histogram * _LEVELS).sum()
    total = lower[-1]
    upper = total - lower
    return _first_maximum(mean * lower - upper * total, lower * upper)


def _first_maximum(difference: npt.NDArray[np.int64], weights: npt.NDArray[np.int64]) -> int | None:
    """Return the lowest T of greatest ``difference^2 / weights``, of those with positive weights.

    Both criteria of Eq. 7 times the squared number of pixels: whole numbers, so that codes
    that no pixel has tie exactly with the code below them.
    """
    if not weights.any():
        return None
    criterion = difference.astype(np.float64) ** 2 / np.maximum(weights, 1)
    return int(np.argmax(np.where(weights > 0, criterion, -1.0)))


def shadow_mask(codes: Codes, threshold: int | None, *, inclusive: bool) -> Mask:
    """Return the mask of Eq. 8, ``(H, W)`` uint8: codes above ``threshold`` (or equal to it)."""
    if threshold is None:
        return np.zeros(codes.shape, np.uint8)
    return (codes >= threshold if inclusive else codes > threshold).view(np.uint8)
