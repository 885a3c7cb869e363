"""What the rows of a result's tables say: totals, windows, causes, worst frames, regions.

Everything is computed from the tables alone, so that a recording of a run that was killed is
understood as well as a complete one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from roadeval.data import FILTERED, OUTCOMES, UNFILTERED, Counts, Rows
from roadeval.data.arrays import Floats, Sums
from roadeval.evaluation import metrics
from roadeval.evaluation.regions import HALVES
from roadeval.evaluation.score.counts import (
    Camera,
    FourCounts,
    FrameCounts,
    Total,
    final_stages,
    means,
    sum_up,
)

FILTER: Final = "filter"
"""The part of an error rate that the filter caused, beside the stages'."""


def finals(rows: Rows) -> Rows:
    """Return the rows of each variant's final mask."""
    masks = dict(rows.groups("variant", "stage"))
    own = [masks[mask] for mask in final_stages(masks).items()]
    return rows.take(np.sort(np.concatenate(own)) if own else slice(0))


def counts_of(rows: Rows) -> FourCounts:
    """Return the counts of rows, ``(n, 4)`` int64."""
    return np.stack([rows[name] for name in OUTCOMES], axis=1)


def region_totals(regions: Rows) -> dict[tuple[str, str, str], Total]:
    """Sum up the rows of ``regions`` by variant, stage and region, frames that have it alone."""
    table, found = counts_of(regions), {}
    for mask, places in regions.groups("variant", "stage", "region"):
        known = table[places]
        found[mask] = sum_up(known[known.any(axis=1)])
    return found


def overlap(total: Mapping[str, Any]) -> dict[str, float]:
    """Compute IoU, F1 and precision of a total's pooled counts."""
    return metrics.overlap(Counts(*(total[name] for name in OUTCOMES)))


def camera_masks(rows: Rows) -> Camera:
    """Return the masks of the rows of ``frames`` of a camera, in the table's order."""
    found = []
    for (variant, stage), places in rows.groups("variant", "stage"):
        own = rows.take(places)
        found.append(FrameCounts(variant, stage, own["frame"], own["stamp_ns"], counts_of(own)))
    return found


def merged(chains: Iterable[Iterable[str]]) -> list[str]:
    """Return the names of several chains in one order, which is that of each chain where it can be.

    >>> merged([("similarity", "svm", "post"), ("trees", "post")])
    ['similarity', 'svm', 'trees', 'post']
    """
    names: list[str] = []
    for chain in chains:
        place = len(names)
        for name in reversed(list(chain)):
            if name in names:
                place = names.index(name)
            else:
                names.insert(place, name)
    return names


class Causes(NamedTuple):
    """Each frame's error rate, taken apart."""

    frames: Sums
    """``(n,)`` int64, rising."""
    parts: dict[str, Floats]
    """``(n,)`` float64 each, by the stage or `FILTER` that caused it, in order."""

    def of(self, frame: int) -> dict[str, float]:
        """Return the parts of a frame's error rate."""
        place = int(np.searchsorted(self.frames, frame))
        return {name: float(part[place]) for name, part in self.parts.items()}

    def means(self) -> dict[str, float]:
        """Return the mean of each part; NaN where it is defined on no frame."""
        known = {name: part[~np.isnan(part)] for name, part in self.parts.items()}
        return {name: float(part.mean()) if len(part) else np.nan for name, part in known.items()}


def causes(rows: Rows, variant: str) -> Causes:
    """Take each frame's error rate apart, stage by stage.

    The final mask's ERR is a sum: the ERR of the mask that the final stage was given, as it is
    without the filter; what the filter changed in that mask (`FILTER`, where both default
    variants ran); and what the final stage changed. The parts add up to ERR exactly. A variant of
    one stage has one part.
    """
    own = rows.of_variant(variant)
    frames = np.unique(own["frame"])
    mine = _errors(own, frames)
    if len(mine) == 1:
        return Causes(frames, mine)
    *_, before, last = mine
    parts = {before: mine[before]}
    if variant == FILTERED:
        without = _errors(rows.of_variant(UNFILTERED), frames)
        if before in without:
            parts = {before: without[before], FILTER: mine[before] - without[before]}
    return Causes(frames, {**parts, last: mine[last] - mine[before]})


def _errors(own: Rows, frames: Sums) -> dict[str, Floats]:
    """Return a variant's ERR on frames by its stages, in the order they ran; NaN where unknown."""
    found = {}
    for (stage,), places in own.groups("stage"):
        found[stage] = np.full(len(frames), np.nan)
        chosen = places[np.isin(own["frame"][places], frames)]
        found[stage][np.searchsorted(frames, own["frame"][chosen])] = own["ERR"][chosen]
    return found


def scene_ns(stamps: Sums) -> int:
    """Return how far apart frames of two scenes are: a quarter of the drive, at most 3 seconds."""
    return min(int(np.ptp(stamps)) // 4, 3_000_000_000) if len(stamps) else 0


def near(stamps: Sums) -> int:
    """Return how far apart frames are that are no neighbours: a 30th of the drive, at most 1 s."""
    return min(int(np.ptp(stamps)) // 30, 1_000_000_000) if len(stamps) else 0


def worst(
    rows: Rows, variant: str, count: int, apart_ns: int | None = None, by: str = "ERR"
) -> Rows:
    """Pick at most ``count`` frames with the highest final ERR of a variant, the worst first.

    Or with the highest value of another column, as of ``unlabelled``.

    Neighbours fail alike, so of frames less than ``apart_ns`` apart, by default `near`, only the
    worst is picked.
    """
    own = finals(rows.of_variant(variant))
    own = own.take(~np.isnan(own[by]))
    ranked = np.argsort(-own[by], kind="stable")
    return own.take(separate(own["stamp_ns"], ranked, count, apart_ns))


def most_changed(
    stamps: Sums,
    changes: Floats,
    count: int,
    *,
    harmed: bool,
    apart_ns: int | None = None,
    besides: Sequence[int] = (),
) -> Sums:
    """Return the places of the frames whose ERR rose most (``harmed``) or fell most.

    Only frames that did rise, or fall, and of neighbours only one, as in `worst`; none that is a
    neighbour of the stamps ``besides``.
    """
    sign = 1 if harmed else -1
    ranked = np.argsort(-sign * changes, kind="stable")
    return separate(stamps, ranked[sign * changes[ranked] > 0], count, apart_ns, besides)


def separate(
    stamps: Sums, ranked: Sums, count: int, apart_ns: int | None = None, besides: Sequence[int] = ()
) -> Sums:
    """Return the first ``count`` places of a ranking that are no neighbours of one before."""
    if apart_ns is None:
        apart_ns = near(stamps)
    places: list[int] = []
    for place in ranked.tolist():
        if len(places) == count:
            break
        taken = np.array([*besides, *stamps[places]], np.int64)
        if (np.abs(taken - stamps[place]) >= apart_ns).all():
            places.append(place)
    return np.array(places, np.int64)


def pairs(rows: Rows, treated: str, control: str) -> Rows:
    """Subtract the final masks' ERR frame by frame, ``treated`` minus ``control``.

    The rows have ``frame`` (rising), ``stamp_ns``, ``ERR``, and the net change of wrong pixels as
    ``wrong``.
    """
    last = finals(rows)
    mine, theirs = (last.of_variant(name) for name in (treated, control))
    frames, here, there = np.intersect1d(mine["frame"], theirs["frame"], return_indices=True)
    mine, theirs = mine.take(here), theirs.take(there)
    wrong, other = (each["FP"] + each["FN"] for each in (mine, theirs))
    change = mine["ERR"] - theirs["ERR"]
    return Rows(
        {"frame": frames, "stamp_ns": mine["stamp_ns"], "ERR": change, "wrong": wrong - other}
    )


def by_region(rows: Rows) -> dict[tuple[str, str], dict[str, float]]:
    """Pool the final masks' counts by region and variant, of frames or of drives.

    By region and variant: the rates of short tables, and ``pixels`` and ``errors``: the region's
    share of all labelled pixels, and of all wrong ones.
    """
    last = finals(rows)
    table, groups = counts_of(last), last.groups("variant", "region")
    sums = {mask: Counts(*table[places].sum(axis=0).tolist()) for mask, places in groups}
    found = {}
    for (variant, region), counts in sums.items():
        whole = [sums[variant, half] for half in HALVES if (variant, half) in sums]
        rates = {name: metric.function(counts) for name, metric in metrics.SHORT.items()}
        pixels = counts.n, sum(each.n for each in whole)
        errors = counts.fp + counts.fn, sum(each.fp + each.fn for each in whole)
        shares = (part / total if total else np.nan for part, total in (pixels, errors))
        found[region, variant] = rates | dict(zip(("pixels", "errors"), shares, strict=True))
    return found


def perfect_stages(oracles: Rows, frames: Rows) -> Iterator[dict[str, Any]]:
    """Yield the mean rates of final masks once a stage was replaced by the truth.

    Each has ``variant``, ``oracle``, the rates, the ``frames`` that have both masks, and ``as_is``:
    the ERR on the same frames as it really is.
    """
    last = finals(frames)
    for (variant, oracle), places in oracles.groups("variant", "oracle"):
        own, real = oracles.take(places), last.of_variant(variant)
        own = own.take(own["stage"] == own["stage"][-1])
        _, here, there = np.intersect1d(own["frame"], real["frame"], return_indices=True)
        rates, as_is = (
            means(metrics.table(counts_of(each))) for each in (own.take(here), real.take(there))
        )
        about = {"variant": variant, "oracle": oracle, "frames": len(here)}
        yield {**about, **rates, "as_is": as_is["ERR"]}
