"""The scoreboard of a drive: frames are scored one by one, added in order and summed up.

Its differences are every variant minus ``unfiltered`` and minus ``blind``, and what was tuned minus
its method. The paper gives no number for figures 3a and 3b, and their curves are lost. What is left
are claims that one mask is wrong less often than another; each window of ten frames bears one out
or does not.
"""

from __future__ import annotations

import math
from array import array
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import add
from typing import Any, Final

import numpy as np

from roadeval.data import (
    BASELINE,
    FILTERED,
    FINAL_STAGE,
    TUNED,
    UNFILTERED,
    Change,
    Doubt,
    Frame,
    FrameResult,
    Role,
    Transition,
    VariantResult,
    as_tree,
)
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.score.counts import (
    Camera,
    EdgesAndFlicker,
    GrowingCounts,
    Name,
    RegionSums,
    Total,
    episodes,
    final_stages,
    sum_up,
    windows,
)
from roadeval.evaluation.score.frame import BlindPrior, score_frame
from roadeval.evaluation.score.metres import MetreSums
from roadeval.evaluation.score.thresholds import Curves, HeatMap
from roadeval.evaluation.score.unlabelled import Unlabelled
from roadeval.evaluation.settings import DEGRADED_ERR, EvaluationSettings
from roadeval.evaluation.stats import CameraRates, Difference, holm, within_drive
from roadeval.geometry.ground import Ground

TESTED: Final = "ERR"
"""The rate whose differences are findings. Those of the final masks against one base are a family,
and corrected for their number; other rates and stages say where a finding comes from."""
BASES: Final = (UNFILTERED, BASELINE)


@dataclass(frozen=True)
class Effect:
    """The paired differences of two masks of a drive, on the frames that both have."""

    base: str
    """The variant that is subtracted: one of `BASES`, or the method that was tuned."""
    variant: str
    stage: str
    """Whose mask."""
    final: bool
    """Whether both are final masks."""
    rates: Mapping[str, Difference]


def within(cameras: Sequence[CameraRates], rate: str, settings: EvaluationSettings) -> Difference:
    """Return the difference of a rate within a drive, given all rates of two masks by camera."""
    place, better = [*METRICS].index(rate), METRICS[rate].higher_is_better
    own = [CameraRates(e.stamps, e.rates[:, place], e.base[:, place]) for e in cameras]
    return within_drive(own, settings, higher_is_better=better)


def drive_effects(cameras: Sequence[Camera], settings: EvaluationSettings) -> list[Effect]:
    """Compute the differences of a drive: of final masks, and of the filter stage by stage."""
    masks = [{mask.name: mask for mask in each} for each in cameras]
    by_name = dict.fromkeys(name for own in masks for name in own)
    finals = final_stages(by_name)
    tuned = {name.removesuffix(TUNED): name for name in finals if name.endswith(TUNED)}
    found = []
    for base in (base for base in (*BASES, *tuned) if base in finals):
        family = []
        for variant, stage in by_name:
            if variant in (base, BASELINE) or variant != tuned.get(base, variant):
                continue
            final = stage == finals[variant]
            other = base, finals[base] if final else stage
            of_filter = (base, variant) == (UNFILTERED, FILTERED)
            if final or (of_filter and other in by_name):
                pairs = [
                    own[variant, stage].paired(own[other])
                    for own in masks
                    if {(variant, stage), other} <= own.keys()
                ]
                rates = {rate: within(pairs, rate, settings) for rate in COMPARED}
                family.append(Effect(base, variant, stage, final, rates))
        found += corrected(family)
    return found


def corrected(effects: Sequence[Effect]) -> list[Effect]:
    """Correct the final masks' differences of `TESTED`, all against one base, for their number."""
    family = iter(holm([each.rates[TESTED] for each in effects if each.final]))
    return [
        replace(each, rates={**each.rates, TESTED: next(family)}) if each.final else each
        for each in effects
    ]


_WITH: Final = (FILTERED, FINAL_STAGE)
_WITHOUT: Final = (UNFILTERED, FINAL_STAGE)
CLAIMS: Final[Mapping[str, tuple[str, Name, Name]]] = {
    **{f"filter_{rate}": (rate, _WITH, _WITHOUT) for rate in ("ERR", "FPR", "FNR")},
    "svm_ERR": ("ERR", (FILTERED, "svm"), (FILTERED, "similarity")),
    "post_ERR": ("ERR", _WITH, (FILTERED, "svm")),
}
"""By the key in ``summary.json``: the rate that is lower for the first mask than for the second.

Section 5 claims so of the filter, section 4.3 of the SVM, section 4.4 of the post-processing."""


def evidence(windows: Iterable[Mapping[str, Any]], size: int) -> dict[str, dict[str, int]]:
    """Count the windows that bear out each claim whose masks the drive has; equal rates do not.

    By claim: how many full ``windows``, of ``size`` frames in both masks, have both rates, and in
    how many it ``held``; ``short`` and ``short_held`` are of windows with fewer frames. Given are
    rows as of `roadeval.evaluation.score.windows`.
    """
    masks: defaultdict[Name, dict[int, Mapping[str, Any]]] = defaultdict(dict)
    for row in windows:
        masks[row["variant"], row["stage"]][row["window"]] = row
    found = {}
    for name, (rate, better, worse) in CLAIMS.items():
        if better in masks and worse in masks:
            counted = dict.fromkeys(("held", "windows", "short_held", "short"), 0)
            for number in masks[better].keys() & masks[worse].keys():
                mine, other = masks[better][number], masks[worse][number]
                full = min(mine["frames"], other["frames"]) == size
                difference = mine[rate] - other[rate]
                counted["windows" if full else "short"] += not math.isnan(difference)
                counted["held" if full else "short_held"] += difference < 0
            found[name] = counted
    return found


Totals = dict[str, dict[str, Total]]
"""By variant and stage."""


class Scoreboard:
    """Scores frames against their truth and sums up the drive.

    ``variants`` are the names of all, in the order of the tables; ``prior`` is the ``blind``
    baseline, or None where no frame with truth was trained on; ``ground`` is what is before the
    camera, where that is known.
    """

    def __init__(
        self,
        settings: EvaluationSettings,
        variants: Sequence[str],
        prior: BlindPrior | None,
        ground: Ground | None = None,
    ) -> None:
        if BASELINE in variants:
            raise ValueError(f"no variant may be called {BASELINE!r}")
        self._settings = settings
        self._order = (*variants, BASELINE)
        self._prior = prior
        self._ground = ground
        self._metres = MetreSums()
        self._above = Curves()
        self._when = array("q")
        """Number and stamp of each evaluated frame."""
        self._roles: Counter[str] = Counter()
        self._health = defaultdict[str, Counter[str]](Counter)
        self._counts = GrowingCounts()
        self._oracles = defaultdict[str, GrowingCounts](GrowingCounts)
        self._regions = RegionSums()
        self.heat = defaultdict[str, HeatMap](HeatMap)
        """Where each variant's final mask errs."""
        self.changes = defaultdict[Transition, Change](Change)
        """Every change between masks."""
        self.curves = Curves()
        self.unlabelled = Unlabelled()
        """The frames without truth."""
        self.apart: dict[int, Mapping[str, float]] = {}
        """ERR of the frames that were picked by rank, by number and variant."""
        self._training = Curves()
        self._edges = EdgesAndFlicker(settings.boundary_width)
        self._seconds = defaultdict[Name, list[float]](lambda: [0.0, 0])

    def score(self, frame: Frame, role: Role, variants: tuple[VariantResult, ...]) -> FrameResult:
        """Score one frame; changes nothing, so any thread may call it at any time."""
        settings, prior = self._settings, self._prior
        return score_frame(frame, role, variants, settings, prior, ground=self._ground)

    def add(self, result: FrameResult) -> tuple[Doubt, ...]:
        """Add a scored frame: in the drive's order, from one thread.

        Returned are the doubts on a frame without truth.
        """
        doubts = self.unlabelled.add(result)
        self._roles[result.role] += 1
        if result.apart:
            self.apart[result.frame.number] = result.apart
        self._edges.add(result)
        for variant in result.variants:
            for stage in variant.stages:
                spent = self._seconds[variant.variant, stage.stage]
                spent[0] += stage.seconds
                spent[1] += 1
        if not result.tallies:
            self._training.add(result.histograms)
            return doubts
        for name, health in result.health.items():
            self._health[name][health] += 1
        number = result.frame.number
        self._when.extend((number, result.frame.stamp_ns))
        self._counts.add(number, result.tallies)
        for oracle, tallies in result.oracles.items():
            self._oracles[oracle].add(number, tallies)
        self._regions.add(result.tallies)
        for name, layer in result.errors.items():
            self.heat[name].add(layer.array.astype(np.uint8, copy=False))
        for step, change in result.changes.items():
            self.changes[step] = Change(*map(add, self.changes[step], change))
        self.curves.add(result.histograms)
        self._metres.add(result.metres)
        self._above.add(result.above)
        return doubts

    def lose(self) -> None:
        """Note that a frame was read here and could not be decoded."""
        self._edges.interrupt()
        self.unlabelled.interrupt()

    def roles(self) -> dict[str, int]:
        """Count the frames added so far by role."""
        return {str(role): count for role, count in self._roles.items()}

    def totals(self) -> Totals:
        """Sum up by variant and stage: see `roadeval.evaluation.score.sum_up`."""
        return totals(self.masks())

    def regions(self) -> dict[tuple[str, str, str], Total]:
        """Sum up by variant, stage and region, as in `totals`."""
        return self._regions.totals()

    def metres(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of ``metres``; none where the camera is not known."""
        return self._metres.totals(self._above)

    def windows(self) -> list[dict[str, Any]]:
        """Cut the drive into windows."""
        return windows(self.masks(), self._settings.window)

    def effects(self) -> list[Effect]:
        """Return the paired differences of the drive."""
        return drive_effects([self.masks()], self._settings)

    def thresholds(self) -> dict[str, dict[str, dict[str, float]]]:
        """Return the evaluated frames' ERR at the threshold that the training frames choose.

        It is the threshold of a method that learnt nothing; for one that learnt from these frames
        it says little. See `Curves.at_best_of`.
        """
        return self.curves.at_best_of(self._training)

    def summary(self) -> dict[str, Any]:
        """Return the parts of ``summary.json`` that the evaluation knows, fit for JSON."""
        seconds = as_tree((name, total / runs) for name, (total, runs) in self._seconds.items())
        curves, beyond, masks = self.curves.totals(), self._edges.totals(), self.masks()
        for mask in {each.variant: each for each in masks}.values():  # the final ones
            errors = mask.rates[:, [*METRICS].index(TESTED)]
            beyond[mask.variant]["episodes"] = episodes(mask.stamps, errors, DEGRADED_ERR)
        oracles = as_tree(
            ((variant, oracle), own)
            for oracle, counts in self._oracles.items()
            for variant, own in totals(self._so_far(counts)).items()
        )
        return {
            "totals": totals(masks),
            "beyond": beyond,
            **({"curves": curves} if curves else {}),
            "oracles": oracles,
            "windows": -(-len(self._when) // (2 * self._settings.window)),
            "claims": evidence(self.windows(), self._settings.window),
            "health": {name: dict(counted) for name, counted in self._health.items()},
            "seconds": seconds,
        }

    def masks(self) -> Camera:
        """Return the counts of every mask, by variant in the tables' order, then as stages ran."""
        return sorted(self._so_far(self._counts), key=lambda mask: self._order.index(mask.variant))

    def _so_far(self, counts: GrowingCounts) -> Camera:
        when = np.array(self._when, np.int64).reshape(-1, 2)
        return [*counts.so_far(when).values()]


def totals(masks: Camera) -> Totals:
    """Sum up masks by variant and stage, as in ``summary.json``: see `sum_up`."""
    return as_tree((mask.name, sum_up(mask.counts)) for mask in masks)
