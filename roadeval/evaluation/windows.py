"""Windows of ten evaluated frames: "an average based on 10 frames" (section 5)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from roadeval.data import Counts
from roadeval.evaluation import metrics
from roadeval.evaluation.frame_counts import FrameCounts, means


@dataclass(frozen=True, slots=True)
class Window:
    """One stage of one variant over consecutive evaluated frames.

    Parameters
    ----------
    number
        From 0.
    first_frame, last_frame
        Frame numbers of the window's ends, both inclusive.
    frames
        Evaluated frames that have this mask; the last window may hold fewer than the others.
    variant, stage
        Whose mask.
    rates
        Mean of the frames' rates, an undefined one left out (the paper's average).
    pooled
        The rates of the summed counts.
    """

    number: int
    first_frame: int
    last_frame: int
    frames: int
    variant: str
    stage: str
    rates: dict[str, float]
    pooled: dict[str, float]


def cut(mask: FrameCounts, frame_numbers: Sequence[int], size: int) -> Iterator[Window]:
    """Cut a drive into windows of ``size`` consecutive evaluated frames.

    Parameters
    ----------
    mask
        The counts of one stage of one variant.
    frame_numbers
        The numbers of all evaluated frames, in order.
    size
        Frames in a window.
    """
    window_of, rates = mask.positions // size, mask.rates
    for number in np.unique(window_of).tolist():
        here = slice(*np.searchsorted(window_of, [number, number + 1]))
        last = min((number + 1) * size, len(frame_numbers)) - 1
        yield Window(
            number=number,
            first_frame=frame_numbers[number * size],
            last_frame=frame_numbers[last],
            frames=here.stop - here.start,
            variant=mask.variant,
            stage=mask.stage,
            rates=means(rates[here]),
            pooled=metrics.of(Counts(*mask.counts[here].sum(axis=0).tolist())),
        )
