"""Where two masks of a drive differ: in which regions, and on which frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from roadeval.data import Rows
from roadeval.evaluation.comparison.pairing import MaskPair
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.regions import titles
from roadeval.evaluation.score import TESTED, FourCounts, counts_of, most_changed

NAMED: Final = 5
"""Frames that are named of those that changed most, in each direction, and of those on which masks
disagree."""
SHADOWS: Final = ("true_shadow", "shadow")
SHADED: Final = 1 / 3
"""The share of the frames that are called those with most shadow."""


@dataclass(frozen=True, slots=True)
class MovedFrame:
    """A frame whose final ERR changed much: that of the base and of the new result."""

    result: str
    variant: str
    frame: int
    stamp_ns: int
    base: float
    new: float
    change: float


@dataclass(frozen=True, slots=True)
class Disagreement:
    """A frame on which two final masks disagree much."""

    result: str
    variant: str
    frame: int
    stamp_ns: int
    base_right: float
    new_right: float
    """Shares of its labelled pixels that the base's mask, or the new one's, alone has right."""


def moved_frames(result: str, mask: MaskPair) -> Iterator[MovedFrame]:
    """Yield the frames whose ERR changed most."""
    place = list(METRICS).index(TESTED)
    before, after = (rates[:, place] for rates in mask.rates)
    stamps, changes = mask.after["stamp_ns"], after - before
    for harmed in (True, False):
        for frame in most_changed(stamps, changes, NAMED, harmed=harmed).tolist():
            was, change = float(before[frame]), float(changes[frame])
            number, stamp = int(mask.after["frame"][frame]), int(stamps[frame])
            yield MovedFrame(result, mask.variant, number, stamp, was, was + change, change)


def disagreements(table: Rows, frames: Rows, base: str, new: str) -> Iterator[Disagreement]:
    """Yield the frames on which two variants of a run disagree most; of neighbours only one.

    ``table`` has the rows of ``disagreements``, ``frames`` rows with the frames' stamps.
    """
    pairs = ((base, new, "repaired", "spoiled"), (new, base, "spoiled", "repaired"))
    stamps = dict(zip(frames["frame"].tolist(), frames["stamp_ns"].tolist(), strict=True))
    for one, other, new_right, base_right in pairs:
        own = table.take((table["from_variant"] == one) & (table["to_variant"] == other))
        own = own.take(np.isin(own["frame"], [*stamps]) & (own["N"] > 0))
        mine, theirs = own[new_right] / own["N"], own[base_right] / own["N"]
        times = np.array([stamps[number] for number in own["frame"].tolist()], np.int64)
        for place in most_changed(times, mine + theirs, NAMED, harmed=True).tolist():
            frame, right = int(own["frame"][place]), (float(theirs[place]), float(mine[place]))
            yield Disagreement(new, new, frame, int(times[place]), *right)


def region_counts(regions: Rows, variant: str, stage: str, frames: Rows) -> dict[str, FourCounts]:
    """Return a mask's counts by region, ``(n, 4)`` each; 0 on a frame that the table lacks.

    ``regions`` has the rows of ``regions``, ``frames`` the mask's rows of ``frames``, in any order.
    """
    numbers = frames["frame"]
    own = regions.take((regions["variant"] == variant) & (regions["stage"] == stage))
    own = own.take(np.isin(own["frame"], numbers))
    order = np.argsort(numbers)
    found = {}
    for name in own.distinct("region"):
        rows = own.take(own["region"] == name)
        found[name] = np.zeros((len(numbers), 4), np.int64)
        found[name][order[np.searchsorted(numbers[order], rows["frame"])]] = counts_of(rows)
    return found


def parts_of(
    base: Mapping[str, FourCounts], new: Mapping[str, FourCounts], mask: MaskPair
) -> Iterator[tuple[str, str, FourCounts, FourCounts]]:
    """Yield a mask's regions and shades: name, title, and the counts of both there.

    A region that is not the same pixels in both, as the shadow that another filter found, is left
    out: its ERR would describe other places. So is one without a labelled pixel.
    """
    alike = [name for name in base if name in new and _same_pixels(base[name], new[name])]
    for name, title in titles([*base]).items():
        known = base[name].any(axis=1)
        if name in alike and known.any():
            yield name, title, base[name][known], new[name][known]
    # True shadow counts where the log has it, else what both results detected alike.
    shadows = [name for name in SHADOWS if name in alike]
    if not shadows:
        return
    share = base[shadows[0]].sum(axis=1) / np.maximum(mask.before["N"], 1)
    much = share >= max(np.sort(share)[-max(round(SHADED * len(share)), 1)], 1e-9)
    if much.any() and not much.all():
        before, after = mask.counts
        yield "frames_with_shadow", "frames with most shadow", before[much], after[much]
        yield "other_frames", "the other frames", before[~much], after[~much]


def _same_pixels(base: FourCounts, new: FourCounts) -> bool:
    """Whether two regions may be the same pixels: of each frame as many, and as much road."""
    same = np.array_equal(base.sum(axis=1), new.sum(axis=1))
    return same and np.array_equal(base[:, [0, 3]].sum(axis=1), new[:, [0, 3]].sum(axis=1))
