"""The scoreboard of a drive: frames are scored one by one, added in order and summed up."""

from __future__ import annotations

import heapq
import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from operator import attrgetter
from typing import Any, Final

import numpy as np

from roadeval.data import (
    BASELINE,
    Change,
    Frame,
    FrameResult,
    Role,
    Transition,
    VariantResult,
)
from roadeval.evaluation.claims import evidence
from roadeval.evaluation.edges_and_flicker import EdgesAndFlicker
from roadeval.evaluation.effects import Effect, drive_effects
from roadeval.evaluation.frame_counts import (
    FrameCounts,
    GrowingCounts,
    RegionSums,
    Window,
    cut,
    paired,
    sum_up,
)
from roadeval.evaluation.maps import HeatMap, Maps, Name
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.score import BlindPrior, score_frame
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.thresholds import Curves, Sums


@dataclass(frozen=True, slots=True, eq=False)
class DriveSums:
    """The content of the drive's tables of sums.

    Windows, changes of masks, heat maps, and pixels by how probable road is.
    """

    windows: Sequence[Window]
    changes: Mapping[Transition, Change]
    heat: Mapping[str, HeatMap]
    probabilities: Mapping[Name, Sums]


class Scoreboard:
    """Scores frames against their truth and sums up the drive.

    Parameters
    ----------
    settings
        What is counted, and how it is judged.
    variants
        The names of all variants, in the order of the tables.
    prior
        The ``blind`` baseline, or None where no frame with truth was trained on.
    """

    def __init__(
        self, settings: EvaluationSettings, variants: Sequence[str], prior: BlindPrior | None
    ) -> None:
        if BASELINE in variants:
            raise ValueError(f"no variant may be called {BASELINE!r}")
        self._settings: Final = settings
        self._order: Final = (*variants, BASELINE)
        self._prior: Final = prior
        self._frames: Final[list[int]] = []
        self._roles: Final[Counter[str]] = Counter()
        self._health: Final[defaultdict[str, Counter[str]]] = defaultdict(Counter)
        self._counts: Final[defaultdict[Name, GrowingCounts]] = defaultdict(GrowingCounts)
        self._oracles: Final[defaultdict[tuple[str, str, str], GrowingCounts]] = defaultdict(
            GrowingCounts
        )
        self._regions: Final = RegionSums()
        self._repeats: Final = Repeats()
        self._maps: Final = Maps()
        self._curves: Final = Curves()
        self._beyond: Final = EdgesAndFlicker(settings.boundary_width)
        self._seconds: Final[defaultdict[Name, float]] = defaultdict(float)
        self._runs: Final[Counter[Name]] = Counter()

    def score(self, frame: Frame, role: Role, variants: tuple[VariantResult, ...]) -> FrameResult:
        """Score one frame; changes nothing, so any thread may call it at any time."""
        return score_frame(frame, role, variants, self._settings, self._prior)

    def add(self, result: FrameResult) -> None:
        """Add a scored frame: in the drive's order, from one thread."""
        self._roles[result.role] += 1
        self._beyond.add(result)
        for variant in result.variants:
            for stage in variant.stages:
                self._seconds[variant.variant, stage.stage] += stage.seconds
                self._runs[variant.variant, stage.stage] += 1
        if not result.tallies:
            return
        for name, health in result.health.items():
            self._health[name][health] += 1
        position = len(self._frames)
        for tally in result.tallies:
            self._counts[tally.variant, tally.stage].append(position, tally.counts)
        for oracle, tallies in result.oracles.items():
            for tally in tallies:
                self._oracles[tally.variant, oracle, tally.stage].append(position, tally.counts)
        self._regions.add(result.tallies)
        self._repeats.add(position, result)
        self._maps.add(result.errors, result.changes)
        self._curves.add(result.histograms)
        self._frames.append(result.frame.number)

    def lose(self) -> None:
        """Note that a frame was read here and could not be decoded."""
        self._beyond.interrupt()

    def sums(self) -> DriveSums:
        """Sum up the drive for its tables; nothing without a score."""
        maps, curves = self._maps, self._curves
        return DriveSums(tuple(self.windows()), maps.changes, maps.heat, curves.counts)

    def roles(self) -> dict[str, int]:
        """Count the frames added so far by role."""
        return {str(role): count for role, count in self._roles.items()}

    def totals(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Sum up by variant and stage: see `roadeval.evaluation.frame_counts.sum_up`."""
        sums: dict[str, dict[str, dict[str, Any]]] = {}
        for mask in self._masks():
            sums.setdefault(mask.variant, {})[mask.stage] = sum_up(mask.counts)
        return sums

    def oracles(self) -> dict[str, dict[str, dict[str, dict[str, Any]]]]:
        """Sum up by variant, stage replaced by the truth, and stage after it, as in `totals`."""
        sums: dict[str, dict[str, dict[str, dict[str, Any]]]] = {}
        for (variant, oracle, stage), growing in self._oracles.items():
            counts = growing.so_far(variant, stage).counts
            sums.setdefault(variant, {}).setdefault(oracle, {})[stage] = sum_up(counts)
        return sums

    def regions(self) -> dict[tuple[str, str, str], dict[str, Any]]:
        """Sum up by variant, stage and region, as in `totals`."""
        return self._regions.totals()

    def windows(self) -> Iterator[Window]:
        """Cut the drive into windows: by window, then variant and stage."""
        rows = (cut(mask, self._frames, self._settings.window) for mask in self._masks())
        return heapq.merge(*rows, key=attrgetter("number"))

    def effects(self) -> list[Effect]:
        """Return the paired differences of the drive."""
        return drive_effects(self._masks(), self._settings)

    def repeats(self) -> dict[str, Any]:
        """Return the rates with each seed: see `roadeval.evaluation.scoreboard.Repeats.rates`."""
        return self._repeats.rates(self._masks())

    def summary(self) -> dict[str, Any]:
        """Return the parts of ``summary.json`` that the evaluation knows, fit for JSON."""
        return {
            "totals": self.totals(),
            "beyond": self._beyond.totals(),
            **self._over_thresholds(),
            "oracles": self.oracles(),
            "windows": -(-len(self._frames) // self._settings.window),
            "claims": self._claims(),
            "health": {name: dict(counted) for name, counted in self._health.items()},
            "seconds": self._mean_seconds(),
        }

    def _over_thresholds(self) -> dict[str, Any]:
        """Return the part ``curves``, where a stage says how probable road is."""
        found = self._curves.totals()
        return {"curves": found} if found else {}

    def _claims(self) -> dict[str, dict[str, int]]:
        found = evidence(self.windows(), self._settings.window)
        return {name: asdict(each) for name, each in found.items()}

    def _masks(self) -> list[FrameCounts]:
        """Return the counts by variant in the tables' order, then by stage as they ran."""
        names = sorted(self._counts, key=lambda name: self._order.index(name[0]))
        return [self._counts[name].so_far(*name) for name in names]

    def _mean_seconds(self) -> dict[str, dict[str, float]]:
        mean: dict[str, dict[str, float]] = {}
        for (variant, stage), total in self._seconds.items():
            mean.setdefault(variant, {})[stage] = total / self._runs[variant, stage]
        return mean


RateLists = dict[str, list[float]]
"""By rate: its value with each seed, in the order of the seeds."""


class Repeats:
    """The counts of every mask of a drive, with each further seed."""

    def __init__(self) -> None:
        self._counts: defaultdict[int, defaultdict[Name, GrowingCounts]] = defaultdict(
            lambda: defaultdict(GrowingCounts)
        )

    def add(self, position: int, result: FrameResult) -> None:
        """Add the evaluated frame at ``position``, counted from 0."""
        for seed, tallies in result.repeats.items():
            for tally in tallies:
                self._counts[seed][tally.variant, tally.stage].append(position, tally.counts)

    def rates(self, masks: Sequence[FrameCounts]) -> dict[str, Any]:
        """Return the rates with each seed, in their order: first those of ``masks``, the run's own.

        Returns
        -------
        dict
            ``totals``, by variant and stage the mean and the pooled rates; ``difference``, by stage
            the mean paired differences, filtered minus unfiltered. Empty without a further seed.
            A mask that no training has to do with is not in it.
        """
        if not self._counts:
            return {}
        trainings = [_by_name(masks)]
        for _, counts in sorted(self._counts.items()):
            trainings.append({name: own.so_far(*name) for name, own in counts.items()})
        names = [name for name in trainings[0] if name in trainings[-1]]
        totals: dict[str, dict[str, RateLists]] = {}
        for variant, stage in names:
            sums = [sum_up(training[variant, stage].counts) for training in trainings]
            totals.setdefault(variant, {})[stage] = {
                rate: [each[rate] for each in sums] for rate in (*METRICS, *_POOLED)
            }
        return {"totals": totals, "difference": _differences(trainings, names)}


_POOLED = tuple(f"pooled_{name}" for name in METRICS)


def _by_name(masks: Sequence[FrameCounts]) -> dict[Name, FrameCounts]:
    return {(mask.variant, mask.stage): mask for mask in masks}


def _differences(
    trainings: Sequence[Mapping[Name, FrameCounts]], names: Sequence[Name]
) -> dict[str, RateLists]:
    """Return the mean paired differences by stage and rate, one a training."""
    found: dict[str, RateLists] = {}
    for training in trainings:
        for stage, table in paired([training[name] for name in names]):
            for rate, values in zip(METRICS, table.T, strict=True):
                if rate in COMPARED:
                    known = values[~np.isnan(values)]
                    mean = float(known.mean()) if len(known) else math.nan
                    found.setdefault(stage, {}).setdefault(rate, []).append(mean)
    return found
