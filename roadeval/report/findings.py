"""What a report is made of: facts that others found, in plain tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from roadeval.report.figures.files import Example
from roadeval.report.pictures import Shot

if TYPE_CHECKING:
    import pandas as pd

Totals = Mapping[str, Mapping[str, Mapping[str, Any]]]
"""Counts and rates by variant and stage, as ``totals`` in ``summary.json``."""


@dataclass(frozen=True, slots=True, eq=False)
class Versus:
    """One variant's final mask against another's, frame by frame.

    Parameters
    ----------
    treated, control
        Variants; differences are the first minus the second.
    differences
        By rate, as in ``summary.json``.
    frames
        Indexed by ``frame``: ``stamp_ns``, the differences by rate, ``wrong`` (net pixels).
    pixels
        Newly right, newly wrong and labelled pixels of the frames sampled; None if not known.
    """

    treated: str
    control: str
    differences: Mapping[str, Mapping[str, Any]]
    frames: pd.DataFrame
    pixels: tuple[int, int, int] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Heat:
    """How often a pixel was a false positive and a false negative; NaN if never labelled."""

    variant: str
    fp: npt.NDArray[np.float64]
    fn: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A frame worth looking at.

    Parameters
    ----------
    frame, stamp_ns
        Which.
    rates
        Of each variant's final mask: ERR, FPR, FNR.
    parts
        How the ERR of ``variant`` came about, by stage, see `Findings.parts`.
    variant
        Whose failure or change it is.
    change
        The filter's change of ERR, or None.
    notes
        The recording's own sentences.
    shots
        The image, the truth and the errors; none where the recording is not at hand.
    rows
        A row a variant: its layers as they came about.
    """

    frame: int
    stamp_ns: int
    variant: str
    rates: Mapping[str, Mapping[str, float]]
    parts: Mapping[str, float] = field(default_factory=dict)
    change: float | None = None
    notes: Sequence[str] = ()
    shots: Sequence[Shot] = ()
    rows: Sequence[Sequence[Shot]] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """Everything that a report of one drive tells.

    Parameters
    ----------
    source
        The recording or folder, as it was named.
    complete
        Whether the run reached its end.
    pictured
        Frames to evaluate, or without truth all, whose pictures are at hand.
    summary
        As ``summary.json``; of an incomplete run, what could be made of its tables.
    properties
        What the recording says of its origin.
    finals
        Each scored variant's final stage.
    windows
        As ``windows.csv``, or coarser rows for a long drive.
    rows
        Evaluated frames in a row of ``windows``.
    versus
        With the filter against without first, if both were run; then against the baseline.
    regions
        As `roadeval.evaluation.analysis.by_region` gives.
    overlap
        IoU, F1 and precision by variant and stage, pooled.
    changes
        ``variant``, ``before``, ``after``, and ``repaired`` and ``spoiled`` as shares of labelled
        pixels.
    parts
        How the mean ERR of each variant came about, by stage.
    heat
        For each variant.
    oracles
        As `roadeval.evaluation.analysis.oracles` gives; empty if the run counted none.
    beyond
        Boundary F and flicker of each final mask, as in ``summary.json``.
    sampled
        Frames that ``heat`` and ``changes`` were counted on; 0 if they are not there.
    examples
        Frames for figure 2.
    thumbnails
        The drive at a glance.
    worst, helped, harmed
        Frames to look at.
    coverage
        Without truth: indexed by frame, a variant a column: the share of the image called road.
    """

    source: str
    complete: bool
    pictured: int
    summary: Mapping[str, Any]
    properties: Mapping[str, Any]
    finals: Mapping[str, str]
    windows: pd.DataFrame
    rows: int
    versus: Sequence[Versus]
    regions: pd.DataFrame
    overlap: Mapping[str, Mapping[str, Mapping[str, float]]]
    changes: pd.DataFrame
    parts: Mapping[str, Mapping[str, float]]
    heat: Sequence[Heat]
    oracles: pd.DataFrame
    beyond: Mapping[str, Mapping[str, Any]]
    sampled: int
    examples: Sequence[Example]
    thumbnails: Sequence[Shot]
    worst: Sequence[Case]
    helped: Sequence[Case]
    harmed: Sequence[Case]
    coverage: pd.DataFrame

    @property
    def totals(self) -> Totals:
        """Counts and rates by variant and stage."""
        totals: Totals = self.summary["totals"]
        return totals

    def total(self, variant: str) -> Mapping[str, Any]:
        """Give the counts and rates of a variant's final mask."""
        return self.totals[variant][self.finals[variant]]
