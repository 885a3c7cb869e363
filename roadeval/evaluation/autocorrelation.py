"""The standard error of a mean over frames that resemble their neighbours.

The standard error is that of the Γ-method [1]_: the autocovariances are summed up to a window that
weighs what is left out against the noise of what is taken in, and corrected for having subtracted
the sample's own mean. It assumes no shape of the correlation. The effective number of frames is
estimated by a first-order autoregression as well, which is steadier on a short series; the smaller
of both, each two standard errors below its estimate, is the cautious number.

References
----------
.. [1] U. Wolff, Monte Carlo Errors with Less Errors, Computer Physics Communications 156, 2004,
   143-153.
.. [2] M. G. Kendall, Note on Bias in the Estimation of Autocorrelation, Biometrika 41, 1954,
   403-404.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Series = npt.NDArray[np.float64]

_WINDOW: Final = 1.5
"""S of [1], section 3.3: the correlation's decay time in units of its integrated time."""
_CAUTION: Final = 2.0
"""Standard errors between the best and the cautious number of effective frames."""


@dataclass(frozen=True, slots=True)
class MeanError:
    """How well a series determines its mean.

    Parameters
    ----------
    standard_error
        Of the mean, in the series' unit.
    degrees
        Degrees of freedom of that standard error, at least 1.
    frames
        Effectively independent frames, at most the series' length.
    frames_low
        The same, cautiously; at least 1.
    """

    standard_error: float
    degrees: float
    frames: float
    frames_low: float


def error_of_mean(series: Series) -> MeanError:
    """Estimate the standard error of the mean of a stationary series.

    Parameters
    ----------
    series
        ``(n,)`` float64, n at least 4, not constant.
    """
    n = len(series)
    covariance = autocovariance(series)
    window = _window(covariance / covariance[0], n)
    total = _sum(covariance, window)
    corrected = covariance[: window + 1] + total / n
    total = max(_sum(corrected, window), float(corrected[0]))
    time = total / (2 * float(corrected[0]))
    doubt = 2 * time * math.sqrt(max(window + 0.5 - time, 0.0) / n)
    by_window = n / (2 * (time + _CAUTION * doubt))
    return MeanError(
        standard_error=math.sqrt(total / n),
        degrees=max(n / (2 * window + 1), 1.0),
        frames=n / (2 * time),
        frames_low=max(min(by_window, _cautious_autoregression(covariance, n)), 1.0),
    )


def autocovariance(series: Series) -> Series:
    """Compute the autocovariances at lags 0 to n-1, each a sum of products over n, not n - lag.

    Parameters
    ----------
    series
        ``(n,)`` float64.
    """
    n = len(series)
    spectrum = np.fft.rfft(series - series.mean(), 2 * n)
    return np.fft.irfft(np.abs(spectrum) ** 2)[:n] / n


def _window(correlation: Series, n: int) -> int:
    """Choose the summation window: the first W where g(W) of [1], eq. 52, is negative."""
    lags = np.arange(1, max(n // 2, 2))
    times = np.maximum(0.5 + np.cumsum(correlation[lags]), 0.5 + 1e-12)
    decay = _WINDOW / np.log((2 * times + 1) / (2 * times - 1))
    negative = np.exp(-lags / decay) < decay / np.sqrt(lags * n)
    return int(lags[np.argmax(negative)]) if negative.any() else int(lags[-1])


def _sum(covariance: Series, window: int) -> float:
    """Sum the autocovariances from lag ``-window`` to ``window``."""
    return float(covariance[0] + 2 * covariance[1 : window + 1].sum())


def _cautious_autoregression(covariance: Series, n: int) -> float:
    """Compute the effective frames of a first-order autoregression, bias-corrected [2].

    The coefficient is taken two standard errors above its estimate.
    """
    coefficient = max(float(covariance[1] / covariance[0]), 0.0)
    unbiased = min(coefficient + (1 + 3 * coefficient) / n, 1.0)
    cautious = min(unbiased + _CAUTION * math.sqrt((1 - unbiased**2) / n), 1.0)
    return n * (1 - cautious) / (1 + cautious)
