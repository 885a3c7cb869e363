"""The scoreboard of a drive: frames are scored one by one, added in order and summed up.

Its differences are every variant minus ``unfiltered`` and minus ``blind``, and what was tuned minus
its method. The paper gives no number for figures 3a and 3b, and their curves are lost. What is left
are claims that one mask is wrong less often than another; each window of ten frames bears one out
or does not.
"""

from __future__ import annotations

from array import array
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import add
from typing import TYPE_CHECKING, Any, Final

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
from roadeval.evaluation import tables
from roadeval.evaluation.metrics import COMPARED, TESTED
from roadeval.evaluation.score.counts import CountedRows, EdgesAndFlicker, Name, episodes
from roadeval.evaluation.score.frame import BlindPrior, score_frame
from roadeval.evaluation.score.metres import MetreSums
from roadeval.evaluation.score.thresholds import Curves, HeatMap
from roadeval.evaluation.score.unlabelled import Unlabelled
from roadeval.evaluation.settings import DEGRADED_ERR, EvaluationSettings
from roadeval.evaluation.stats.difference import Difference, holm, within_drive
from roadeval.evaluation.tables import KEY, final_stages, masks_of, only, paired
from roadeval.geometry.ground import Ground

if TYPE_CHECKING:
    import pandas as pd

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


def drive_effects(frames: pd.DataFrame, settings: EvaluationSettings) -> list[Effect]:
    """Compute the differences of a drive: of final masks, and of the filter stage by stage."""
    masks = masks_of(frames)
    finals = final_stages(masks)
    tuned = {name.removesuffix(TUNED): name for name in finals if name.endswith(TUNED)}
    effects = []
    for base in (base for base in (*BASES, *tuned) if base in finals):
        family = []
        for variant, stage in masks:
            if variant in (base, BASELINE) or variant != tuned.get(base, variant):
                continue
            final = stage == finals[variant]
            other = base, finals[base] if final else stage
            of_filter = (base, variant) == (UNFILTERED, FILTERED)
            if final or (of_filter and other in masks):
                pairs = paired(
                    only(frames, variant=base, stage=other[1]),
                    only(frames, variant=variant, stage=stage),
                    [*KEY, "frame", "stamp_ns"],
                )
                rates = {rate: within_drive(pairs, rate, settings) for rate in COMPARED}
                family.append(Effect(base, variant, stage, final, rates))
        effects += corrected(family)
    return effects


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


def evidence(windows: pd.DataFrame, size: int) -> dict[str, dict[str, int]]:
    """Count the windows that bear out each claim whose masks the drive has; equal rates do not.

    By claim: how many full ``windows``, of ``size`` frames in both masks, have both rates, and in
    how many it ``held``; ``short`` and ``short_held`` are of windows with fewer frames.
    """
    counted = {}
    masks = set(masks_of(windows))
    for name, (rate, better, worse) in CLAIMS.items():
        if not {better, worse} <= masks:
            continue
        base, new = (only(windows, variant=mask[0], stage=mask[1]) for mask in (worse, better))
        pairs = paired(base, new, [*KEY, "window"])
        difference = pairs[rate] - pairs[f"{rate}_base"]
        full = pairs[["frames", "frames_base"]].min(axis=1) == size
        held, known = difference < 0, difference.notna()
        counts = {"held": full & held, "windows": full & known}
        counts |= {"short_held": ~full & held, "short": ~full & known}
        counted[name] = {key: int(chosen.sum()) for key, chosen in counts.items()}
    return counted


class Scoreboard:
    """Scores frames against their truth and sums up the drive.

    ``key`` are the drive and the camera; ``variants`` the names of all, in the order of the tables;
    ``prior`` is the ``blind`` baseline, or None where no frame with truth was trained on;
    ``ground`` is what is before the camera, where that is known.
    """

    def __init__(
        self,
        key: tuple[str, str],
        settings: EvaluationSettings,
        variants: Sequence[str],
        prior: BlindPrior | None,
        ground: Ground | None = None,
    ) -> None:
        if BASELINE in variants:
            raise ValueError(f"no variant may be called {BASELINE!r}")
        self._key = key
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
        self._counts = CountedRows("variant", "stage")
        self._oracles = CountedRows("variant", "oracle", "stage")
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
        place = len(self._when) // 2
        self._when.extend((result.frame.number, result.frame.stamp_ns))
        self._counts.add(place, (((t.variant, t.stage), t.counts) for t in result.tallies))
        for oracle, tallies in result.oracles.items():
            names = (((t.variant, oracle, t.stage), t.counts) for t in tallies)
            self._oracles.add(place, names)
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

    def metres(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of ``metres``; none where the camera is not known."""
        return self._metres.totals(self._above)

    def frames(self) -> pd.DataFrame:
        """Return the rows of ``frames`` so far, without log times."""
        return self._counts.table(self._frames_added(), {"variant": self._order})

    def _frames_added(self) -> pd.DataFrame:
        import pandas as pd

        when = np.array(self._when, np.int64).reshape(-1, 2)
        drive, camera = (pd.Categorical([word] * len(when)) for word in self._key)
        key = {"drive": drive, "camera": camera}
        return pd.DataFrame({**key, "frame": when[:, 0], "stamp_ns": when[:, 1]})

    def thresholds(self) -> dict[str, dict[str, dict[str, float]]]:
        """Return the evaluated frames' ERR at the threshold that the training frames choose.

        It is the threshold of a method that learnt nothing; for one that learnt from these frames
        it says little. See `Curves.at_best_of`.
        """
        return self.curves.at_best_of(self._training)

    def summary(self) -> DriveSums:
        """Sum up the drive."""
        settings, frames = self._settings, self.frames()
        seconds = as_tree((name, total / runs) for name, (total, runs) in self._seconds.items())
        curves, beyond = self.curves.totals(), self._edges.totals()
        for (variant,), rows in tables.grouped(tables.finals(frames), ["variant"]):
            stamps, errors = (rows[name].to_numpy() for name in ("stamp_ns", TESTED))
            beyond[variant]["episodes"] = episodes(stamps, errors, DEGRADED_ERR)
        oracles = self._oracles.table(self._frames_added(), {})
        replaced: dict[str, dict[str, Any]] = {}
        for (oracle,), rows in tables.grouped(oracles, ["oracle"]):
            for variant, own in tables.as_trees(tables.totals(rows)).items():
                replaced.setdefault(variant, {})[oracle] = own
        windows = tables.windows(frames, settings.window)
        parts = {
            "totals": tables.as_trees(tables.totals(frames)),
            "beyond": beyond,
            **({"curves": curves} if curves else {}),
            "oracles": replaced,
            "windows": -(-len(self._when) // (2 * settings.window)),
            "claims": evidence(windows, settings.window),
            "health": {name: dict(counted) for name, counted in self._health.items()},
            "seconds": seconds,
        }
        return DriveSums(frames, windows, drive_effects(frames, settings), parts)


@dataclass(frozen=True, eq=False)
class DriveSums:
    """Sums over the frames of one camera of a drive."""

    frames: pd.DataFrame
    windows: pd.DataFrame
    effects: Sequence[Effect]
    parts: Mapping[str, Any]
    """The parts of ``summary.json`` that the evaluation knows."""

    @property
    def times(self) -> dict[str, int]:
        """Header stamps of the first and the last evaluated frame; none without any."""
        stamps = self.frames["stamp_ns"]
        return (
            {"start_ns": int(stamps.iloc[0]), "end_ns": int(stamps.iloc[-1])} if len(stamps) else {}
        )
