"""Totals, windows, causes and worst frames, computed from the rows of ``frames.csv``.

Of arrays and without pandas, for the commands that answer at once; what only a report shows is in
`roadeval.evaluation.analysis`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import FILTERED, OUTCOMES, UNFILTERED, Counts, Rows
from roadeval.evaluation import effects, metrics
from roadeval.evaluation.frame_counts import FourCounts, FrameCounts, Window, cut, sum_up

FILTER: Final = "filter"
"""The part of an error rate that the filter caused, beside the stages'."""

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def final_stages(rows: Rows) -> dict[str, str]:
    """Return each variant's final stage: ``post``, or the last that it has."""
    return effects.final_stages((variant, stage) for variant, stage, _ in rows.masks())


def each_window(windows: Rows) -> Rows:
    """Return one row of each window, in order, with the most ``frames`` that a mask has there."""
    numbers, first, place = np.unique(windows["window"], return_index=True, return_inverse=True)
    most = np.zeros(len(numbers), np.int64)
    np.maximum.at(most, place, windows["frames"])
    return windows.take(first).replace(frames=most)


def finals(rows: Rows) -> Rows:
    """Return the rows of each variant's final mask; `analysis.finals` does so for a DataFrame."""
    last = final_stages(rows)
    own = [places for variant, stage, places in rows.masks() if stage == last[variant]]
    return rows.take(np.sort(np.concatenate(own)) if own else slice(0))


def counts(rows: Rows) -> FourCounts:
    """Return the counts of rows, ``(n, 4)`` int64."""
    return np.stack([rows[name] for name in OUTCOMES], axis=1)


def totals(rows: Rows) -> dict[str, dict[str, dict[str, Any]]]:
    """Sum up by variant and stage, as in ``summary.json``."""
    sums: dict[str, dict[str, dict[str, Any]]] = {}
    for variant, stage, places in rows.masks():
        sums.setdefault(variant, {})[stage] = sum_up(counts(rows.take(places)))
    return sums


def region_totals(regions: Rows) -> dict[tuple[str, str, str], dict[str, Any]]:
    """Sum up the rows of ``regions`` by variant, stage and region, frames that have it alone."""
    names = zip(*(regions[name].tolist() for name in ("variant", "stage", "region")), strict=True)
    places: dict[tuple[str, str, str], list[int]] = {}
    for place, name in enumerate(names):
        places.setdefault(name, []).append(place)
    table = counts(regions)
    found = {}
    for name, own in places.items():
        known = table[own]
        found[name] = sum_up(known[known.any(axis=1)])
    return found


def overlap(total: Mapping[str, Any]) -> dict[str, float]:
    """Compute IoU, F1 and precision of a total's pooled counts."""
    return metrics.overlap(Counts(*(total[name] for name in OUTCOMES)))


def mask_counts(rows: Rows) -> Iterator[FrameCounts]:
    """Yield the counts of each variant's stages, in the table's order."""
    places = {number: place for place, number in enumerate(rows.distinct("frame"))}
    for variant, stage, chosen in rows.masks():
        own = rows.take(chosen)
        positions = np.array([places[number] for number in own["frame"].tolist()], np.int64)
        yield FrameCounts(variant, stage, positions, counts(own))


def windows(rows: Rows, size: int) -> Iterator[Window]:
    """Cut the drive into windows of ``size`` evaluated frames, one mask after the other."""
    numbers = rows.distinct("frame")
    for mask in mask_counts(rows):
        yield from cut(mask, numbers, size)


# --- Which stage broke it -------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Causes:
    """Each frame's error rate, taken apart."""

    frames: Ints
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


def _errors(own: Rows, frames: Ints) -> dict[str, Floats]:
    """Return a variant's ERR on frames by its stages, in the order they ran; NaN where unknown."""
    found = {}
    for _, stage, places in own.masks():
        found[stage] = np.full(len(frames), np.nan)
        chosen = places[np.isin(own["frame"][places], frames)]
        found[stage][np.searchsorted(frames, own["frame"][chosen])] = own["ERR"][chosen]
    return found


# --- Frames worth opening -------------------------------------------------------------------------


def worst(rows: Rows, variant: str, count: int, apart_ns: int | None = None) -> Rows:
    """Pick the frames with the highest final ERR of a variant, the worst first.

    Neighbours fail alike, so of frames less than ``apart_ns`` apart only the worst is picked: by
    default a thirtieth of the drive, and at most a second.

    Returns
    -------
    Rows
        At most ``count`` of them.
    """
    own = rows.of_variant(variant)
    own = own.take(own["stage"] == final_stages(own).get(variant, ""))
    own = own.take(~np.isnan(own["ERR"]))
    stamps = own["stamp_ns"]
    ranked = np.argsort(-own["ERR"], kind="stable")
    return own.take(_apart(stamps, ranked, count, apart_ns))


def most_changed(stamps: Ints, changes: Floats, count: int, *, harmed: bool) -> Ints:
    """Return the places of the frames whose ERR rose most (``harmed``) or fell most.

    Only frames that did rise, or fall, and of neighbours only one, as in `worst`.
    """
    sign = 1 if harmed else -1
    ranked = np.argsort(-sign * changes, kind="stable")
    return _apart(stamps, ranked[sign * changes[ranked] > 0], count)


def _apart(stamps: Ints, ranked: Ints, count: int, apart_ns: int | None = None) -> Ints:
    """Return the first ``count`` places of a ranking that are no neighbours of one before.

    Parameters
    ----------
    stamps
        ``(n,)`` int64, in nanoseconds, of all frames.
    ranked
        Places in ``stamps``.
    count
        How many are wanted.
    apart_ns
        Frames less than that apart are neighbours; see `worst` for the default.
    """
    if apart_ns is None:
        apart_ns = min(int(np.ptp(stamps)) // 30, 1_000_000_000) if len(stamps) else 0
    taken: list[int] = []
    places: list[int] = []
    for place, stamp in zip(ranked.tolist(), stamps[ranked].tolist(), strict=True):
        if len(taken) == count:
            break
        if all(abs(stamp - other) >= apart_ns for other in taken):
            taken.append(stamp)
            places.append(place)
    return np.array(places, np.int64)
