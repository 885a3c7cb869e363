"""The content of a report on one drive or on many, as a job collects it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from roadeval.data import BASELINE, Rows
from roadeval.data.words import defined
from roadeval.evaluation.stats import Difference
from roadeval.report.blocks import ImageFile
from roadeval.report.charts.standard import Behind, Interval
from roadeval.report.images import ExampleFrame, LayerImage
from roadeval.results.facts import Facts, FleetFacts, Totals
from roadeval.results.rows import as_arrays
from roadeval.results.schema import FAILED


@dataclass(frozen=True, slots=True, eq=False)
class PairedComparison:
    """One variant's final mask against another's, frame by frame."""

    treated: str
    control: str
    """Variants; differences are the first minus the second."""
    differences: Mapping[str, Difference]
    """By rate."""
    frames: Rows
    """See `roadeval.evaluation.score.pairs`."""
    pixels: tuple[int, int, int] | None = None
    """Newly right, newly wrong and labelled pixels; None of a run that was killed."""


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
    of_camera: Callable[[str], Commands] | None = None
    """Of a rig: makes those of a camera, by its name."""


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
    facts: Facts
    """Of an incomplete run, what its tables allow to compute."""
    properties: Mapping[str, Any]
    """The recording's own, about its origin."""
    windows: Rows
    """As ``windows.csv``, or longer windows for a long drive."""
    paired: Sequence[PairedComparison]
    """Each variant against unfiltered, if it was run; then each against the baseline."""
    regions: Mapping[tuple[str, str], Mapping[str, float]]
    """See `roadeval.evaluation.score.by_region`."""
    overlap: Mapping[str, Mapping[str, Mapping[str, float]]]
    """IoU, F1 and precision by variant and stage, pooled."""
    changes: Mapping[tuple[str, str], tuple[float, float]]
    """By variant and stage: the shares of labelled pixels that it repaired and spoiled."""
    error_parts: Mapping[str, Mapping[str, float]]
    """The parts of each variant's mean ERR by stage, see `roadeval.evaluation.score.causes`."""
    heatmaps: Mapping[str, npt.NDArray[np.float64]]
    """By variant ``(2, rows, columns)``, how often FP and FN are there; NaN if never labelled."""
    oracles: Sequence[Mapping[str, Any]]
    """See `roadeval.evaluation.score.perfect_stages`; empty if the run counted none."""
    levels: Rows
    """As ``probabilities.csv``; empty where no stage says how probable road is."""
    examples: Sequence[ExampleFrame]
    """Frames for figure 2."""
    thumbnails: Sequence[LayerImage]
    """A few frames, evenly over the drive."""
    worst: Sequence[NotableFrame]
    helped: Sequence[NotableFrame]
    harmed: Sequence[NotableFrame]
    """Frames to look at."""
    coverage: Mapping[str, Mapping[int, float]]
    """Without truth: by variant and frame the share of the image called road."""
    behind: Behind = field(default_factory=dict)
    """The frames behind the numbers of stages and regions."""
    cameras: Mapping[str, Findings] = field(default_factory=dict)
    """Of a rig: each camera's own, by its name. What is here is little beside facts and
    differences, then."""
    camera: str = ""
    """Of a rig: which camera this is."""
    metres: Rows = field(default_factory=partial(as_arrays, "metres", ()))
    """As ``metres.csv``; empty where the camera is not known."""
    by_distance: Mapping[tuple[str, str], Interval] = field(default_factory=dict)
    """Mean ERR with its interval, by band of distance and variant."""

    @property
    def name(self) -> str:
        """The drive's name, and of a rig the camera's."""
        return ", ".join(filter(None, (self.facts.drive.name, self.camera)))

    @property
    def height(self) -> int:
        """Height of the frames in pixels."""
        return self.facts.drive.height

    @property
    def totals(self) -> Totals:
        """Counts and rates by variant and stage."""
        return self.facts.totals

    @property
    def finals(self) -> Mapping[str, str]:
        """Each scored variant's final stage."""
        return self.facts.finals

    def total(self, variant: str) -> Mapping[str, Any]:
        """Return the counts and rates of a variant's final mask."""
        return self.totals[variant][self.finals[variant]]


Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class WorstPicture:
    """One of the worst frames over all drives; without a picture where none is left."""

    rank: int
    drive: str
    frame: int
    rates: Mapping[str, float]
    picture: ImageFile | None


@dataclass(frozen=True, slots=True)
class FleetFindings:
    """Everything that a report of many drives shows."""

    name: str
    source: str
    """The fleet's folder."""
    facts: FleetFacts
    drives: Mapping[str, Row]
    """Rows of ``drives`` by the drives' identity."""
    names: Mapping[str, str]
    """The drives' names for people, by their identity; no two are equal."""
    effects: Mapping[tuple[str, str], Sequence[Row]]
    """Rows of ``effects`` of the final masks' ERR, by base and variant."""
    regions: Mapping[tuple[str, str], Mapping[str, float]]
    """See `roadeval.evaluation.score.by_region`: of all drives together."""
    scores: Sequence[Row]
    """Rows of ``scores`` of the first variant's final mask, over all labelled pixels."""
    worst: Sequence[WorstPicture] = ()
    """The worst frames over all drives."""
    inspect: Callable[[int], str] | None = None
    """Returns the command that opens one of them, by its rank; None where the report is not made at
    a terminal."""

    @property
    def finals(self) -> Mapping[str, str]:
        """Each scored variant's final stage."""
        return {row["variant"]: row["stage"] for row in self.facts.rates}

    @property
    def height(self) -> int:
        """Height of the frames in pixels; 0 where drives differ."""
        heights = {row["height"] or 0 for row in self.drives.values() if row["evaluated"]}
        return heights.pop() if len(heights) == 1 else 0

    def pages(self) -> dict[str, str]:
        """Return where each drive's own page lies below that of a served fleet.

        By the drives' identity; a drive that failed has none.
        """
        return {
            drive: f"drive/{place}/"
            for place, (drive, row) in enumerate(self.drives.items())
            if row["status"] != FAILED
        }


def worse_than_baseline(errors: Mapping[str, float | None]) -> list[str]:
    """Return the variants with a higher ERR than the baseline, where that is known."""
    blind = errors.get(BASELINE)
    if not defined(blind):
        return []
    return [name for name, error in errors.items() if defined(error) and error > blind]
