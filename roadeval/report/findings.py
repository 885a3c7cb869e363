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
class ErrorHeatmap:
    """How often a pixel was a false positive and a false negative; NaN if never labelled."""

    variant: str
    fp: npt.NDArray[np.float64]
    fn: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class NotableFrame:
    """A frame worth looking at.

    Parameters
    ----------
    frame, stamp_ns
        Which.
    rates
        Of each variant's final mask, as short tables show them.
    parts
        The parts of the ERR of ``variant``, by stage, see `Findings.error_parts`.
    variant
        Whose failure or change it is.
    change
        The filter's change of ERR, or None.
    notes
        The recording's own sentences.
    images
        The camera, the truth and the errors; none where the recording is not at hand.
    layers
        A row a variant: its layers in the order of the stages.
    """

    frame: int
    stamp_ns: int
    variant: str
    rates: Mapping[str, Mapping[str, float]]
    parts: Mapping[str, float] = field(default_factory=dict)
    change: float | None = None
    notes: Sequence[str] = ()
    images: Sequence[LayerImage] = ()
    layers: Sequence[Sequence[LayerImage]] = ()


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
    """Everything that a report of one drive shows.

    Parameters
    ----------
    source
        The recording or folder, as it was named.
    complete
        Whether the run reached its end.
    commands
        What to type for more; None where the report is not made at a terminal.
    viewable
        Whether ``commands`` open frames in the viewer: the recording is there.
    pictured
        Number of frames with pictures, of those evaluated, or without truth of all.
    summary
        As ``summary.json``; of an incomplete run, what its tables allow to compute.
    properties
        The recording's own, about its origin.
    finals
        Each scored variant's final stage.
    windows
        As ``windows.csv``, or longer windows for a long drive.
    window_size
        Evaluated frames in a window.
    paired
        Filtered against unfiltered first, if both were run; then against the baseline.
    regions
        See `roadeval.evaluation.analysis.by_region`.
    overlap
        IoU, F1 and precision by variant and stage, pooled.
    changes
        ``variant``, ``before``, ``after``, and ``repaired`` and ``spoiled`` as shares of labelled
        pixels.
    error_parts
        The parts of each variant's mean ERR by stage, see `roadeval.evaluation.scored.causes`.
    heatmaps
        One a variant.
    oracles
        See `roadeval.evaluation.analysis.oracles`; empty if the run counted none.
    beyond
        Boundary F and flicker of each final mask, as in ``summary.json``.
    levels
        As ``probabilities.csv``; empty where no stage says how probable road is.
    sampled
        Frames that ``heatmaps`` and ``changes`` were counted on; 0 if there are none.
    examples
        Frames for figure 2.
    thumbnails
        A few frames, evenly over the drive.
    worst, helped, harmed
        Frames to look at.
    coverage
        Without truth: indexed by frame, a variant a column: the share of the image called road.
    """

    source: str
    complete: bool
    commands: Commands | None
    viewable: bool
    pictured: int
    summary: Mapping[str, Any]
    properties: Mapping[str, Any]
    finals: Mapping[str, str]
    windows: Rows
    window_size: int
    paired: Sequence[PairedComparison]
    regions: pd.DataFrame
    overlap: Mapping[str, Mapping[str, Mapping[str, float]]]
    changes: pd.DataFrame
    error_parts: Mapping[str, Mapping[str, float]]
    heatmaps: Sequence[ErrorHeatmap]
    oracles: pd.DataFrame
    beyond: Mapping[str, Mapping[str, Any]]
    levels: Rows
    sampled: int
    examples: Sequence[ExampleFrame]
    thumbnails: Sequence[LayerImage]
    worst: Sequence[NotableFrame]
    helped: Sequence[NotableFrame]
    harmed: Sequence[NotableFrame]
    coverage: pd.DataFrame

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
