"""The scoreboard of a drive: frames are scored one by one, added in order and summed up.

Differences are computed for each variant minus ``unfiltered`` and minus ``blind``, and for each
tuned variant minus its method. The paper gives no numbers for figures 3a and 3b, and their curves
are lost. Only its claims that one mask is wrong less often than another can be checked: each window
of ten frames confirms a claim or does not.
"""

from __future__ import annotations

import math
from array import array
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from operator import add
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval import data
from roadeval.data import BASELINE, FILTERED, FINAL_STAGE, OUTCOMES, TUNED, UNFILTERED, as_tree
from roadeval.data.arrays import Floats, Sums
from roadeval.evaluation import tables
from roadeval.evaluation.metrics import COMPARED, METRICS, TESTED
from roadeval.evaluation.score.classes import ClassSums
from roadeval.evaluation.score.conditions import FrameConditions
from roadeval.evaluation.score.counts import EdgesAndFlicker, Name
from roadeval.evaluation.score.degradation import degradations
from roadeval.evaluation.score.frame import BlindPrior, score_frame
from roadeval.evaluation.score.kitti import benchmark
from roadeval.evaluation.score.metre_sums import MetreSums
from roadeval.evaluation.score.thresholds import Curves, HeatMap
from roadeval.evaluation.score.unlabelled import Unlabelled
from roadeval.evaluation.settings import DEGRADED_ERR, EvaluationSettings
from roadeval.evaluation.stats.difference import Difference, holm, within_drive
from roadeval.evaluation.stats.slices import LEAST_FRAMES, Slice, find_slices
from roadeval.evaluation.tables import KEY, final_stages, masks_of, only, pair_rows, rates_of
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
    final: bool
    """Whether both are final masks."""
    rates: Mapping[str, Difference]


def drive_effects(frames: pd.DataFrame, settings: EvaluationSettings) -> list[Effect]:
    """Compute the differences of a drive: between final masks, and by the filter at each stage."""
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
                pairs = pair_rows(
                    only(frames, variant=base, stage=other[1]),
                    only(frames, variant=variant, stage=stage),
                    [*KEY, "frame", "stamp_ns"],
                )
                rates = {rate: within_drive(pairs, rate, settings) for rate in COMPARED}
                family.append(Effect(base, variant, stage, final, rates))
        effects += correct_effects(family)
    return effects


def correct_effects(effects: Sequence[Effect]) -> list[Effect]:
    """Correct p-values of final masks' differences of `TESTED` from one base for their number."""
    family = iter(holm([effect.rates[TESTED] for effect in effects if effect.final]))
    return [
        replace(effect, rates={**effect.rates, TESTED: next(family)}) if effect.final else effect
        for effect in effects
    ]


_WITH: Final = (FILTERED, FINAL_STAGE)
_WITHOUT: Final = (UNFILTERED, FINAL_STAGE)
CLAIMS: Final[Mapping[str, tuple[str, Name, Name]]] = {
    **{f"filter_{rate}": (rate, _WITH, _WITHOUT) for rate in ("ERR", "FPR", "FNR")},
    "svm_ERR": ("ERR", (FILTERED, "svm"), (FILTERED, "similarity")),
    "post_ERR": ("ERR", _WITH, (FILTERED, "svm")),
}
"""Claims by key in ``summary.json``: the rate is lower for the first mask than for the second.

Section 5 has the claims on the filter, section 4.3 on the SVM, section 4.4 on post-processing."""


def evidence(windows: pd.DataFrame, size: int) -> dict[str, dict[str, int]]:
    """Count the windows that confirm each claim; equal rates do not confirm it.

    The result has, by claim, the number of full ``windows``, with ``size`` frames of both masks,
    in which both rates are defined, and the number in which the claim ``held``; ``short`` and
    ``short_held`` count windows with fewer frames. A claim is left out if the drive lacks a mask.
    """
    keys = [*KEY, "window"]
    by_mask = {mask: rows.set_index(keys) for mask, rows in tables.group_rows(windows, tables.MASK)}
    evidence_by_claim = {}
    for name, (rate, better, worse) in CLAIMS.items():
        if not {better, worse} <= by_mask.keys():
            continue
        base, new = by_mask[worse], by_mask[better]
        difference = new[rate] - base[rate]
        full = (new["frames"] == size) & (base["frames"] == size)
        held, defined = difference < 0, difference.notna()
        counts = {"held": full & held, "windows": full & defined}
        counts |= {"short_held": ~full & held, "short": ~full & defined}
        evidence_by_claim[name] = {key: int(rows.sum()) for key, rows in counts.items()}
    return evidence_by_claim


class CountedRows:
    """Counts of masks, added frame by frame: 24 bytes a mask and frame, until they are a table."""

    def __init__(self, *names: str) -> None:
        self._names: Final = names
        """Columns that name a mask, such as variant and stage."""
        self._rows: Final = array("I")
        """The place of the frame, the place of the names, and the four counts of each row."""
        self._places: Final[dict[tuple[str, ...], int]] = {}

    def add(self, place: int, counts: Iterable[tuple[tuple[str, ...], data.Counts]]) -> None:
        """Add the counts of the evaluated frame at a place, by their names."""
        for names, four in counts:
            row = self._places.setdefault(names, len(self._places))
            self._rows.extend((place, row, *four))

    def table(self, when: pd.DataFrame, orders: Mapping[str, Sequence[str]]) -> pd.DataFrame:
        """Return the rows with their rates, in the order in which they were added.

        ``when`` has a row for each frame, at its place. ``orders`` has the order of the names of a
        column; by default they are in the order in which they first occur.
        """
        import pandas as pd

        rows = np.array(self._rows, np.int64).reshape(-1, 6)
        table = when.iloc[rows[:, 0]].reset_index(drop=True)
        columns = [*zip(*self._places, strict=True)] or [()] * len(self._names)
        for name, words in zip(self._names, columns, strict=True):
            order = orders.get(name) or [*dict.fromkeys(words)]
            codes = np.array([order.index(word) for word in words], np.int64)[rows[:, 1]]
            table[name] = pd.Categorical.from_codes(codes, pd.Index([*order]))
        table[[*OUTCOMES]] = rows[:, 2:]
        table["N"] = rows[:, 2:].sum(axis=1)
        return table.join(rates_of(table, METRICS))


def episodes(stamps: Sums, errors: Floats, limit: float) -> dict[str, Any]:
    """Return how long a drive's ERR was at or above a limit, and how soon it recovered.

    ``stamps`` are ``(n,)`` nanoseconds of evaluated frames, ``errors`` their ERR; NaN is left out.
    An episode lasts from its first frame to the first frame below the limit, where it has
    ``recovered``. If the drive ends earlier, or a gap exceeds both a second and three usual steps,
    it lasts to its last frame and has not recovered. Times are in seconds, without gaps; ``share``
    is the share of the drive, ``recovery`` the median time of the episodes that recovered.
    """
    defined = np.flatnonzero(~np.isnan(errors))
    defined = defined[np.argsort(stamps[defined], kind="stable")]
    steps = np.diff(stamps[defined])
    gap = max(1_000_000_000, 3 * np.median(steps)) if len(steps) else 0
    lasting, times, recovered = False, [0.0] * 0, [0.0] * 0
    for error, step in zip_longest(errors[defined].tolist(), steps.tolist(), fillvalue=math.inf):
        if error >= limit and not lasting:
            times.append(0)
        elif error < limit and lasting:
            recovered.append(times[-1])
        lasting = error >= limit and step <= gap
        if lasting:
            times[-1] += step
    return {
        "limit": limit,
        "episodes": len(times),
        "recovered": len(recovered),
        "seconds": sum(times) / 1e9,
        "share": sum(times) / (int(steps[steps <= gap].sum()) or math.nan),
        "longest": max(times, default=0) / 1e9,
        "recovery": float(np.median(recovered)) / 1e9 if recovered else None,
    }


class Scoreboard:
    """Scores frames against their truth and sums up the drive.

    ``key`` are the drive and the camera; ``variants`` are all names, in the order of the tables;
    ``prior`` is the ``blind`` baseline, or None if no frame with truth was trained on; ``ground``
    is None if the camera is not known; frames without truth are ranked by the doubts on the variant
    ``focus``, by default the first one.
    """

    def __init__(
        self,
        key: tuple[str, str],
        settings: EvaluationSettings,
        variants: Sequence[str],
        prior: BlindPrior | None,
        ground: Ground | None = None,
        *,
        focus: str | None = None,
    ) -> None:
        if BASELINE in variants:
            raise ValueError(f"{BASELINE!r} is the baseline: rename the variant")
        self._key = key
        self._settings = settings
        self._order = (*variants, BASELINE)
        self._prior = prior
        self._ground = ground
        self._metres = MetreSums()
        self._above = Curves()
        self._kitti = Curves()
        self._when = array("q")
        """Number and stamp of each evaluated frame."""
        self._roles: Counter[str] = Counter()
        self._health = defaultdict[str, Counter[str]](Counter)
        self._counts = CountedRows("variant", "stage")
        self._oracles = CountedRows("variant", "oracle", "stage")
        self._disturbed = CountedRows("disturbance", "variant", "stage")
        self.heat = defaultdict[str, HeatMap](HeatMap)
        """Heat maps of the errors of final masks, by variant."""
        self.changes = defaultdict[data.Transition, data.Change](data.Change)
        """Sums of the changes between masks."""
        self.curves = Curves()
        self.classes = ClassSums()
        self.unlabelled = Unlabelled(focus or next(iter(variants), ""))
        """The frames without truth."""
        self.apart: dict[int, Mapping[str, float]] = {}
        """ERR of the frames that were picked by rank, by number and variant."""
        self.conditions = FrameConditions()
        self._training = Curves()
        self._edges = EdgesAndFlicker(settings.boundary_width)
        self._seconds = defaultdict[Name, list[float]](lambda: [0.0, 0])

    def score(
        self, frame: data.Frame, role: data.Role, variants: tuple[data.VariantResult, ...]
    ) -> data.FrameResult:
        """Score one frame; this changes nothing, so any thread may call it at any time."""
        settings, prior = self._settings, self._prior
        return score_frame(frame, role, variants, settings, prior, ground=self._ground)

    def add(self, result: data.FrameResult) -> tuple[data.Doubt, ...]:
        """Add a scored frame, and return its doubts if it has no truth.

        Frames are added in the drive's order, from one thread.
        """
        doubts = self.unlabelled.add(result)
        self.conditions.add(result)
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
        for name, disturbed in result.disturbed.items():
            finals = (((name, t.variant, t.stage), t.counts) for t in disturbed.tallies)
            self._disturbed.add(place, finals)
        for name, layer in result.errors.items():
            self.heat[name].add(layer.array.astype(np.uint8, copy=False))
        for step, change in result.changes.items():
            self.changes[step] = data.Change(*map(add, self.changes[step], change))
        self.curves.add(result.histograms)
        self.classes.add(result.frame.moment, result.classes)
        self._metres.add(result.metres)
        self._above.add(result.above)
        self._kitti.add(result.kitti)
        return doubts

    def lose(self) -> None:
        """Note that a frame was read here and could not be decoded."""
        self._edges.interrupt()
        self.unlabelled.interrupt()
        self.conditions.interrupt()

    def roles(self) -> dict[str, int]:
        """Count the frames added so far by role."""
        return {str(role): count for role, count in self._roles.items()}

    def metres(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of ``metres``; none if the camera is not known."""
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
        """Return the evaluated frames' ERR at the threshold that is best on the training frames.

        This tells little about a method that learnt from these frames. See `Curves.at_best_of`.
        """
        return self.curves.at_best_of(self._training)

    def summary(self, classes: Sequence[data.TruthClass] = ()) -> DriveSums:
        """Sum up the drive; ``classes`` are the classes of its truth, in the order of codes."""
        settings, frames = self._settings, self.frames()
        seconds = as_tree((name, total / runs) for name, (total, runs) in self._seconds.items())
        curves, beyond = self.curves.totals(), self._edges.totals()
        for (variant,), rows in tables.group_rows(tables.finals(frames), ["variant"]):
            stamps, errors = (rows[name].to_numpy() for name in ("stamp_ns", TESTED))
            beyond[variant]["episodes"] = episodes(stamps, errors, DEGRADED_ERR)
        oracles = self._oracles.table(self._frames_added(), {})
        replaced: dict[str, dict[str, Any]] = {}
        for (oracle,), rows in tables.group_rows(oracles, ["oracle"]):
            for variant, stages in tables.as_trees(tables.totals(rows)).items():
                replaced.setdefault(variant, {})[oracle] = stages
        windows = tables.windows(frames, settings.window)
        disturbed = self._disturbed.table(self._frames_added(), {})
        parts = {
            "totals": tables.as_trees(tables.totals(frames)),
            "beyond": beyond,
            **({"curves": curves} if curves else {}),
            "oracles": replaced,
            "disturbances": degradations(disturbed, frames, settings),
            "windows": -(-len(self._when) // (2 * settings.window)),
            "claims": evidence(windows, settings.window),
            "kitti": benchmark(self._kitti),
            "health": {name: dict(counted) for name, counted in self._health.items()},
            "seconds": seconds,
            "slices": self._slices(frames, classes),
        }
        return DriveSums(frames, windows, drive_effects(frames, settings), parts, disturbed)

    def parts(self, classes: Sequence[data.TruthClass] = ()) -> pd.DataFrame:
        """Return the counts of the frames' parts, see `FrameConditions.parts`."""
        return self.conditions.parts(classes if any(self.classes.rows(classes)) else ())

    def _slices(
        self, frames: pd.DataFrame, classes: Sequence[data.TruthClass]
    ) -> dict[str, list[Slice]]:
        """Return the slices of final masks by variant, if they have enough frames."""
        key, confidence = dict(zip(KEY, self._key, strict=True)), self._settings.confidence
        conditions = self.conditions.table().assign(**key)
        parts = self.parts(classes).assign(**key)
        return {
            variant: find_slices(rows, conditions, only(parts, variant=variant), confidence)
            for (variant,), rows in tables.group_rows(tables.finals(frames), ["variant"])
            if variant != BASELINE and len(rows) >= LEAST_FRAMES
        }


@dataclass(frozen=True, eq=False)
class DriveSums:
    """Sums over the frames of one camera of a drive."""

    frames: pd.DataFrame
    windows: pd.DataFrame
    effects: Sequence[Effect]
    parts: Mapping[str, Any]
    """The parts of ``summary.json`` that the evaluation computes."""
    disturbed: pd.DataFrame
    """The counts of final masks of disturbed frames."""

    @property
    def times(self) -> dict[str, int]:
        """Header stamps of the first and the last evaluated frame; empty if there are none."""
        stamps = self.frames["stamp_ns"].tolist()
        return {"start_ns": stamps[0], "end_ns": stamps[-1]} if stamps else {}
