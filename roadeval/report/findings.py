"""The content of a report on one drive: facts, tables, and the frames to show."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE
from roadeval.data.arrays import Floats
from roadeval.data.words import defined
from roadeval.evaluation import tables
from roadeval.evaluation.metres import band_name
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.score.unlabelled import SIGNS
from roadeval.evaluation.stats.autocorrelation import mean_distribution
from roadeval.evaluation.tables import group_rows, only, values_of
from roadeval.report.charts.standard import Interval
from roadeval.report.images import ExampleFrame, LayerImage
from roadeval.results.facts import Facts
from roadeval.results.tables import read_table

if TYPE_CHECKING:
    import pandas as pd

WINDOWS: Final = 30
"""Greatest number of points of the figures over the drive."""


@dataclass(frozen=True, eq=False)
class NotableFrame:
    """A frame, in a table or with its pictures."""

    frame: int
    stamp_ns: int
    variant: str
    """The variant that fails or changes; in a table of frames the focus."""
    rates: Mapping[str, Mapping[str, float]]
    """The final mask's rates by variant, as in short tables; without truth its signs of doubt."""
    change: float | None = None
    """The filter's effect on ERR, or None."""
    notes: Sequence[str] = ()
    """Sentences about it."""
    conditions: Sequence[str] = ()
    """Conditions in words, such as ``much shadow``."""
    images: Sequence[LayerImage] = ()
    """The camera, the truth and the errors; empty without the recording."""
    layers: Sequence[Sequence[LayerImage]] = ()
    """A row for each variant: its layers in the order of the stages."""

    @property
    def error(self) -> float:
        """ERR of `variant`, or without truth its first sign of doubt; -1 if none is defined."""
        rates = self.rates.get(self.variant, {})
        return next((rates[by] for by in (TESTED, *SIGNS) if defined(rates.get(by))), -1.0)


@dataclass(frozen=True, eq=False)
class Findings:
    """The content of a report on one drive."""

    path: str
    """The recording or folder, as the user named it."""
    facts: Facts
    """The facts; an incomplete run has only the facts that its tables give."""
    table: Callable[[str], pd.DataFrame] = lambda name: read_table(name, "")
    """The function that returns a table by its name; by default without rows."""
    complete: bool = True
    """Whether the run reached its end."""
    again: str = ""
    """The command that makes the results again; empty if the configuration is lost."""
    inspect: Callable[[int], str] | None = None
    """The function that returns the command to open a frame in the viewer; None without a
    recording."""
    properties: Mapping[str, Any] = field(default_factory=dict)
    """The recording's properties, about its origin."""
    pictured: int = 0
    """Number of evaluated frames with pictures; of a drive without any, of all with pictures."""
    examples: Sequence[ExampleFrame] = ()
    """Frames for figure 2."""
    thumbnails: Sequence[LayerImage] = ()
    """A few frames, evenly over the drive."""
    worst: Sequence[NotableFrame] = ()
    helped: Sequence[NotableFrame] = ()
    harmed: Sequence[NotableFrame] = ()
    """Frames with the greatest errors, and frames that the filter helped or harmed most."""
    cameras: Mapping[str, Findings] = field(default_factory=dict)
    """Findings of each camera of a rig, by its name; a rig has no tables of its own."""
    camera: str = ""
    """The name of this camera in a rig."""

    @property
    def name(self) -> str:
        """The drive's name, followed by the camera's in a rig."""
        return ", ".join(filter(None, (self.facts.drive.name, self.camera)))

    @property
    def height(self) -> int:
        """Height of the frames in pixels."""
        return self.facts.drive.height

    @cached_property
    def windows(self) -> pd.DataFrame:
        """The rows of ``windows``; a long drive has longer windows."""
        size, windows = self.facts.evaluation.window, self.table("windows")
        frames = self.table("frames")
        count = -(-frames["frame"].nunique() // size)
        if not count or (count <= WINDOWS and len(windows)):
            return windows
        return tables.windows(frames, size * -(-count // WINDOWS))

    @cached_property
    def regions(self) -> pd.DataFrame:
        """The rows of `roadeval.evaluation.tables.by_region`: rates and shares by region."""
        return tables.by_region(self.table("regions"))

    @cached_property
    def changes(self) -> Mapping[tuple[str, str], Sequence[float]]:
        """The shares of labelled pixels that a stage repaired and spoiled, by variant and stage."""
        steps = self.table("changes").astype({"from_variant": str, "to_variant": str})
        steps = steps[(steps["from_variant"] == steps["to_variant"]) & (steps["N"] > 0)]
        shares = steps[["repaired", "spoiled"]].div(steps["N"], axis=0)
        masks = zip(steps["to_variant"], steps["to_stage"], strict=True)
        return dict(zip(masks, shares.to_numpy().tolist(), strict=True))

    @cached_property
    def error_parts(self) -> Mapping[str, Mapping[str, float]]:
        """Mean parts of ERR by variant and part, see `roadeval.evaluation.tables.causes`."""
        frames = self.table("frames")
        names = [name for name in values_of(frames, "variant") if name != BASELINE]
        means = ((name, tables.causes(frames, name).mean()) for name in names)
        return {name: dict(zip(parts.index, parts, strict=True)) for name, parts in means}

    @cached_property
    def heatmaps(self) -> Mapping[str, Floats]:
        """Shares of FP and FN by variant, ``(2, rows, columns)``; NaN in cells never labelled."""
        maps = {}
        for (name,), cells in group_rows(self.table("heat"), ["variant"]):
            rows, columns = (cells[edge] // cells["side"] for edge in ("top", "left"))
            maps[name] = np.zeros((2, rows.max() + 1, columns.max() + 1))
            maps[name][:, rows, columns] = cells[["FP", "FN"]].div(cells["labelled"], axis=0).T
        return maps

    @cached_property
    def by_distance(self) -> Mapping[tuple[str, str], Interval]:
        """Mean ERR with its interval, as fractions, by band of distance and variant."""
        rows, settings = tables.finals(self.table("regions")), self.facts.evaluation
        rows = rows[rows["N"] > 0]
        errors = (rows["FP"] + rows["FN"]) / rows["N"]
        intervals: dict[tuple[str, str], Interval] = {}
        for band in (band_name(*ends) for ends in pairwise(settings.distances)):
            for variant in values_of(rows, "variant"):
                shares = errors[only(rows, region=band, variant=variant).index].to_numpy()
                if len(shares):
                    low = high = None
                    if len(shares) >= settings.least_frames and np.ptp(shares):
                        ends = mean_distribution(shares).interval(settings.confidence)
                        low, high = np.clip(ends, 0, 1).tolist()
                    intervals[band, variant] = float(shares.mean()), low, high
        return intervals
