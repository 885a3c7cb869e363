"""Mean differences between variants, and the intervals around them.

Both variants see the same frames, so their rates are subtracted frame by frame and the differences
averaged. The interval around that mean is Student's, of the standard error and the degrees of
freedom that `roadeval.evaluation.autocorrelation` estimates. Where a cautious count of effectively
independent frames is below ten there is no interval: no method can know there how wide it should
be.

How often an interval that claims 95 % holds the true mean, in percent of 1,000 made-up drives
(``tests/evaluation/coverage.py`` prints it); "naive" takes the frames for independent:

===============================  ======  ========  =====  =====
differences of like neighbours   frames  withheld  given  naive
===============================  ======  ========  =====  =====
autoregression, correlation 0.5      91       9.9   94.3   74.4
autoregression, correlation 0.5     500       0.0   96.1   74.5
autoregression, correlation 0.5    2000       0.0   94.3   74.3
autoregression, correlation 0.9      91      99.9      *   33.1
autoregression, correlation 0.9     500      13.6   95.4   33.3
autoregression, correlation 0.9    2000       0.0   94.8   33.9
slow (0.95), half of it noise        91      48.0   58.5   36.2
slow (0.95), half of it noise       500       4.8   90.0   33.4
slow (0.95), half of it noise      2000       0.0   93.1   36.2
bursts (0.9), else nothing           91      79.9   15.4   34.3
bursts (0.9), else nothing          500       2.8   89.3   40.2
bursts (0.9), else nothing         2000       0.0   93.1   36.7
===============================  ======  ========  =====  =====

(*) One drive of the thousand was given an interval, and it did not hold. The short drives at the
bottom show what no estimate can mend: a drift that noise hides, or bursts that a drive happened not
to meet, cannot be seen in 91 frames. An interval knows nothing of what its drive did not show.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from roadeval.evaluation.autocorrelation import Series, error_of_mean
from roadeval.evaluation.settings import EvaluationSettings

METHOD: Final = "Student's t of paired frames, with the Γ-method's standard error"


@dataclass(frozen=True, slots=True)
class Interval:
    """An interval around a mean, or why there is none; see `Difference`."""

    low: float | None = None
    high: float | None = None
    method: str | None = None
    effective_frames: float | None = None
    effective_frames_low: float | None = None
    reason: str | None = None


@dataclass(frozen=True, slots=True)
class Difference:
    """A mean of paired differences over a drive's frames, with its interval. Fractions.

    Parameters
    ----------
    mean
        NaN if no frame has a difference.
    low, high
        The interval, or None where none is given.
    confidence
        What the interval claims.
    method
        How the interval was made, or None.
    frames
        Frames with a difference.
    effective_frames, effective_frames_low
        Effectively independent frames among them: the best estimate, and the cautious one that
        decides whether there is an interval. None where it cannot be estimated.
    reason
        Why there is no interval, or why it has no width; else None.
    """

    mean: float
    low: float | None
    high: float | None
    confidence: float
    method: str | None
    frames: int
    effective_frames: float | None
    effective_frames_low: float | None
    reason: str | None


def mean_difference(differences: Series, settings: EvaluationSettings) -> Difference:
    """Average paired differences, with an interval.

    Parameters
    ----------
    differences
        ``(n,)`` float64, one a frame in the drive's order; NaN where a rate is undefined, which
        leaves the frame out.
    settings
        Confidence, and the least number of effective frames.
    """
    known = differences[~np.isnan(differences)]
    found = interval(known, settings)
    return Difference(
        mean=float(known.mean()) if len(known) else math.nan,
        confidence=settings.confidence,
        frames=len(known),
        **asdict(found),
    )


def interval(values: Series, settings: EvaluationSettings) -> Interval:
    """Compute an interval around the mean of a drive's values, neighbours of which are alike.

    Parameters
    ----------
    values
        ``(n,)`` float64, in the drive's order.
    settings
        Confidence, and the least number of effective frames.
    """
    from scipy.special import stdtrit

    n, least = len(values), settings.effective_frames
    if n < least:
        return Interval(reason=f"there are {n} frames, and an interval needs {least}")
    mean = float(values.mean())
    if np.ptp(values) == 0:
        return Interval(mean, mean, None, n, n, "the same on every frame")
    error = error_of_mean(values)
    if error.frames_low < least:
        reason = (
            f"{n} frames are worth about {error.frames:.0f} independent ones, perhaps only "
            f"{error.frames_low:.0f}, and an interval needs {least}"
        )
        return Interval(None, None, None, error.frames, error.frames_low, reason)
    half = float(stdtrit(error.degrees, (1 + settings.confidence) / 2)) * error.standard_error
    return Interval(mean - half, mean + half, METHOD, error.frames, error.frames_low)
