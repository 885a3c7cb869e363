"""The content of a report on one drive: tables, frames and facts that a job has collected."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from roadeval.data import Rows
from roadeval.report.images import ExampleFrame, LayerImage

if TYPE_CHECKING:
    import pandas as pd

Totals = Mapping[str, Mapping[str, Mapping[str, Any]]]
"""Counts and rates by variant and stage, as ``totals`` in ``summary.json``."""


@dataclass(frozen=True, slots=True, eq=False)
class PairedComparison:
    """One variant's final mask against another's, frame by frame."""

    treated: str
    control: str
    """Variants; differences are the first minus the second."""
    differences: Mapping[str, Mapping[str, Any]]
    """By rate, as in ``summary.json``."""
    frames: pd.DataFrame
    """Indexed by ``frame``: ``stamp_ns``, the differences by rate, ``wrong`` (net pixels)."""
    pixels: tuple[int, int, int] | None = None
    """Newly right, newly wrong and labelled pixels of the frames sampled; None if not known."""


@dataclass(frozen=True, slots=True, eq=False)
class ErrorHeatmap:
    """How often a pixel was a false positive and a false negative; NaN if never labelled."""

    variant: str
    fp: npt.NDArray[np.float64]
    fn: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class NotableFrame:
    """A frame worth looking at."""

    frame: int
    stamp_ns: int
    """Which."""
    variant: str
    """Whose failure or change it is."""
    rates: Mapping[str, Mapping[str, float]]
    """Of each variant's final mask, as short tables show them."""
    parts: Mapping[str, float] = field(default_factory=dict)
    """The parts of the ERR of ``variant``, by stage, see `Findings.error_parts`."""
    change: float | None = None
    """The filter's change of ERR, or None."""
    notes: Sequence[str] = ()
    """The recording's own sentences."""
    images: Sequence[LayerImage] = ()
    """The camera, the truth and the errors; none where the recording is not at hand."""
    layers: Sequence[Sequence[LayerImage]] = ()
    """A row a variant: its layers in the order of the stages."""


@dataclass(frozen=True, slots=True)
class Commands:
    """Commands for a terminal, as they are typed.

    ``again`` makes the results again from the log, whose path it is given, where the result holds
    its configuration; ``inspect`` opens the viewer at a frame, whose number it is given.
    """

    again: Callable[[str], str] | None
    inspect: Callable[[int], str]


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """Everything that a report of one drive shows."""

    source: str
    """The recording or folder, as it was named."""
    complete: bool
    """Whether the run reached its end."""
    commands: Commands | None
    """What to type for more; None where the report is not made at a terminal."""
    viewable: bool
    """Whether ``commands`` open frames in the viewer: the recording is there."""
    pictured: int
    """Number of frames with pictures, of those evaluated, or without truth of all."""
    summary: Mapping[str, Any]
    """As ``summary.json``; of an incomplete run, what its tables allow to compute."""
    properties: Mapping[str, Any]
    """The recording's own, about its origin."""
    finals: Mapping[str, str]
    """Each scored variant's final stage."""
    windows: Rows
    """As ``windows.csv``, or longer windows for a long drive."""
    window_size: int
    """Evaluated frames in a window."""
    paired: Sequence[PairedComparison]
    """Filtered against unfiltered first, if both were run; then against the baseline."""
    regions: pd.DataFrame
    """See `roadeval.evaluation.score.by_region`."""
    overlap: Mapping[str, Mapping[str, Mapping[str, float]]]
    """IoU, F1 and precision by variant and stage, pooled."""
    changes: pd.DataFrame
    """``variant``, ``before``, ``after``, and ``repaired`` and ``spoiled`` as shares of labelled
    pixels.
    """
    error_parts: Mapping[str, Mapping[str, float]]
    """The parts of each variant's mean ERR by stage, see `roadeval.evaluation.score.causes`."""
    heatmaps: Sequence[ErrorHeatmap]
    """One a variant."""
    oracles: pd.DataFrame
    """See `roadeval.evaluation.score.perfect_stages`; empty if the run counted none."""
    beyond: Mapping[str, Mapping[str, Any]]
    """Boundary F and flicker of each final mask, as in ``summary.json``."""
    levels: Rows
    """As ``probabilities.csv``; empty where no stage says how probable road is."""
    sampled: int
    """Frames that ``heatmaps`` and ``changes`` were counted on; 0 if there are none."""
    examples: Sequence[ExampleFrame]
    """Frames for figure 2."""
    thumbnails: Sequence[LayerImage]
    """A few frames, evenly over the drive."""
    worst: Sequence[NotableFrame]
    helped: Sequence[NotableFrame]
    harmed: Sequence[NotableFrame]
    """Frames to look at."""
    coverage: pd.DataFrame
    """Without truth: indexed by frame, a variant a column: the share of the image called road."""

    @property
    def drive(self) -> str:
        """The drive's name."""
        return str(self.summary["drive"]["name"])

    @property
    def totals(self) -> Totals:
        """Counts and rates by variant and stage."""
        totals: Totals = self.summary["totals"]
        return totals

    def total(self, variant: str) -> Mapping[str, Any]:
        """Return the counts and rates of a variant's final mask."""
        return self.totals[variant][self.finals[variant]]
