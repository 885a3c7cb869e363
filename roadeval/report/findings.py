"""The content of a report on one drive: its facts and tables, and the frames that a job picked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import BASELINE, FILTERED, UNFILTERED, Rows
from roadeval.data.words import defined
from roadeval.evaluation import score
from roadeval.evaluation.metres import band_name
from roadeval.evaluation.stats import mean_distribution
from roadeval.report.charts.standard import Interval
from roadeval.report.images import ExampleFrame, LayerImage
from roadeval.results.facts import Facts, Totals
from roadeval.results.rows import as_arrays, window_table

WINDOWS: Final = 30
"""Points of the figures over the drive, at most."""


@dataclass(frozen=True, eq=False)
class NotableFrame:
    """A frame, in a table or with its pictures."""

    frame: int
    stamp_ns: int
    """Which."""
    variant: str
    """Whose failure or change it is; empty of a row of a table, and without truth."""
    rates: Mapping[str, Mapping[str, float]]
    """Of each variant's final mask, as short tables show them; without truth its doubts."""
    parts: Mapping[str, float] = field(default_factory=dict)
    """The parts of the ERR of ``variant``, by stage, see `Findings.error_parts`."""
    change: float | None = None
    """The filter's change of ERR, or None."""
    notes: Sequence[str] = ()
    """Sentences about it."""
    conditions: Sequence[str] = ()
    """In words, as ``much shadow``."""
    images: Sequence[LayerImage] = ()
    """The camera, the truth and the errors; none where the recording is not at hand."""
    layers: Sequence[Sequence[LayerImage]] = ()
    """A row a variant: its layers in the order of the stages."""

    @property
    def error(self) -> float:
        """The ERR of the first variant, or its first doubt; below 0 where none is defined."""
        rates = next(iter(self.rates.values()), {})
        return next((rates[by] for by in ("ERR", *score.SIGNS) if defined(rates.get(by))), -1.0)


def no_rows(table: str) -> Rows:
    """Return a table without a row."""
    return as_arrays(table, ())


@dataclass(frozen=True, eq=False)
class Findings:
    """Everything that a report of one drive shows."""

    path: str
    """The recording or folder, as it was named."""
    facts: Facts
    """Of an incomplete run, what its tables allow to compute."""
    table: Callable[[str], Rows] = no_rows
    """Returns the rows of a table by its name."""
    complete: bool = True
    """Whether the run reached its end."""
    again: str = ""
    """The command that makes the results again; empty where their configuration is lost."""
    inspect: Callable[[int], str] | None = None
    """Returns the command that opens a frame in the viewer; None without a recording."""
    properties: Mapping[str, Any] = field(default_factory=dict)
    """The recording's own, about its origin."""
    pictured: int = 0
    """Number of frames with pictures, of those evaluated, or without truth of all."""
    examples: Sequence[ExampleFrame] = ()
    """Frames for figure 2."""
    thumbnails: Sequence[LayerImage] = ()
    """A few frames, evenly over the drive."""
    worst: Sequence[NotableFrame] = ()
    helped: Sequence[NotableFrame] = ()
    harmed: Sequence[NotableFrame] = ()
    """Frames to look at."""
    cameras: Mapping[str, Findings] = field(default_factory=dict)
    """Of a rig: each camera's own, by its name; there are no tables of all together."""
    camera: str = ""
    """Of a rig: which camera this is."""

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

    @cached_property
    def windows(self) -> Rows:
        """The rows of ``windows``; longer windows where the drive is long."""
        size, windows = self.facts.evaluation.window, self.table("windows")
        rows = self.table("frames")
        count = -(-len(rows.distinct("frame")) // size)
        if not count or (count <= WINDOWS and len(windows)):
            return windows
        size *= -(-count // WINDOWS)
        return window_table(score.camera_masks(rows), size)

    @cached_property
    def filtered(self) -> Rows:
        """The filter's effect frame by frame: see `roadeval.evaluation.score.pairs`."""
        return score.pairs(self.table("frames"), FILTERED, UNFILTERED)

    @cached_property
    def regions(self) -> Mapping[tuple[str, str], Mapping[str, float]]:
        """See `roadeval.evaluation.score.by_region`."""
        return score.by_region(self.table("regions"))

    @cached_property
    def changes(self) -> Mapping[tuple[str, str], tuple[float, float]]:
        """By variant and stage: the shares of labelled pixels that it repaired and spoiled."""
        changes = self.table("changes")
        known = (changes["from_variant"] == changes["to_variant"]) & (changes["N"] > 0)
        own = changes.take(known)
        masks = zip(own["to_variant"].tolist(), own["to_stage"].tolist(), strict=True)
        shares = ((own[name] / own["N"]).tolist() for name in ("repaired", "spoiled"))
        return dict(zip(masks, zip(*shares, strict=True), strict=True))

    @cached_property
    def pixels(self) -> tuple[int, int, int] | None:
        """Pixels that the filter made right and wrong, and labelled ones; None of a killed run."""
        changes = self.table("changes")
        chosen = (changes["from_variant"] == UNFILTERED) & (changes["to_variant"] == FILTERED)
        own = changes.take(chosen & (changes["N"] > 0))
        columns = (own[name].tolist() for name in ("repaired", "spoiled", "N"))
        return next(zip(*columns, strict=True), None)

    @cached_property
    def error_parts(self) -> Mapping[str, Mapping[str, float]]:
        """The parts of each variant's mean ERR by stage, see `roadeval.evaluation.score.causes`."""
        rows = self.table("frames")
        names = [name for name in rows.distinct("variant") if name != BASELINE]
        return {name: score.causes(rows, name).means() for name in names}

    @cached_property
    def heatmaps(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """By variant ``(2, rows, columns)``, how often FP and FN are there; NaN if not labelled."""
        heat, found = self.table("heat"), {}
        for name in heat.distinct("variant"):
            cells = heat.of_variant(name)
            rows, columns = (cells[edge] // cells["side"][0] for edge in ("top", "left"))
            found[name] = np.full((2, rows.max() + 1, columns.max() + 1), np.nan)
            for share, outcome in zip(found[name], ("FP", "FN"), strict=True):
                share[rows, columns] = cells[outcome] / cells["labelled"]
        return found

    @cached_property
    def oracles(self) -> Sequence[Mapping[str, Any]]:
        """See `roadeval.evaluation.score.perfect_stages`; empty if the run counted none."""
        return [*score.perfect_stages(self.table("oracles"), self.table("frames"))]

    @cached_property
    def levels(self) -> Rows:
        """The rows of ``probabilities``; none where no stage says how probable road is."""
        return self.table("probabilities")

    @cached_property
    def metres(self) -> Rows:
        """The rows of ``metres``; none where the camera is not known."""
        return self.table("metres")

    @cached_property
    def by_distance(self) -> Mapping[tuple[str, str], Interval]:
        """Mean ERR with its interval, by band of distance and variant."""
        rows, settings = score.finals(self.table("regions")), self.facts.evaluation
        found: dict[tuple[str, str], Interval] = {}
        for variant in rows.distinct("variant"):
            own = rows.of_variant(variant)
            for band in (band_name(*ends) for ends in pairwise(settings.distances)):
                there = own.take((own["region"] == band) & (own["N"] > 0))
                errors = (there["FP"] + there["FN"]) / there["N"]
                if len(errors):
                    low = high = None
                    if len(errors) >= settings.least_frames and np.ptp(errors):
                        ends = mean_distribution(errors).interval(settings.confidence)
                        low, high = np.clip(ends, 0, 1).tolist()
                    found[band, variant] = float(errors.mean()), low, high
        return found
