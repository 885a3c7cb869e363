"""Where one of two masks is better: by region and by shade, and on which frames they disagree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Rows
from roadeval.evaluation import scored
from roadeval.evaluation.comparison_result import Disagreement, RegionComparison
from roadeval.evaluation.regions import titles
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import Difference, mean_difference

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

MOST: Final = 5
"""Frames named of those on which two masks disagree."""
SHADOWS: Final = ("true_shadow", "shadow")
SHADED: Final = 1 / 3
"""The share of the frames that are called those with most shadow."""


@dataclass(frozen=True, slots=True, eq=False)
class RegionCounts:
    """A mask's counts in a region on some frames, ``(n,)`` int64 each: all, road and wrong pixels.

    All are 0 on a frame that the table lacks.
    """

    pixels: Ints
    road: Ints
    wrong: Ints

    @property
    def err(self) -> Floats:
        """``(n,)``: ERR; NaN without a labelled pixel."""
        err = np.full(len(self.pixels), np.nan)
        np.divide(self.wrong, self.pixels, out=err, where=self.pixels > 0)
        return err

    def has_the_pixels_of(self, other: RegionCounts) -> bool:
        """Whether two regions may be the same pixels: of each frame as many, and as much road."""
        same = np.array_equal(self.pixels, other.pixels)
        return same and np.array_equal(self.road, other.road)


def region_counts(regions: Rows, variant: str, stage: str, frames: Ints) -> dict[str, RegionCounts]:
    """Return a mask's counts by region.

    Parameters
    ----------
    regions
        The rows of ``regions.csv``.
    variant, stage
        Whose mask.
    frames
        ``(n,)``, each once, in any order.
    """
    own = regions.take((regions["variant"] == variant) & (regions["stage"] == stage))
    own = own.take(np.isin(own["frame"], frames))
    order = np.argsort(frames)
    found = {}
    for name in own.distinct("region"):
        rows = own.take(own["region"] == name)
        places = order[np.searchsorted(frames[order], rows["frame"])]
        counts = np.zeros((3, len(frames)), np.int64)
        counts[:, places] = rows["N"], rows["TP"] + rows["FN"], rows["FP"] + rows["FN"]
        found[name] = RegionCounts(*counts)
    return found


def by_region(
    base: Mapping[str, RegionCounts],
    new: Mapping[str, RegionCounts],
    settings: EvaluationSettings,
    *,
    result: str,
    variant: str,
) -> Iterator[RegionComparison]:
    """Yield what changed in each region that both have, in the order in which regions are shown.

    One that is not the same pixels in both, as the shadow that another filter found, is left out:
    its ERR would tell of other places. So is one without a labelled pixel.
    """
    for name, title in titles([*base]).items():
        if name not in new or not base[name].has_the_pixels_of(new[name]):
            continue
        before, after = base[name].err, new[name].err
        known = ~np.isnan(before)
        if not known.any():
            continue
        difference = mean_difference(after, before, settings)
        rates = before[known], after[known]
        yield _compared(result, variant, name, title, rates=rates, difference=difference)


def by_shade(
    base: Mapping[str, RegionCounts],
    new: Mapping[str, RegionCounts],
    rates: tuple[Rows, Rows],
    settings: EvaluationSettings,
    *,
    result: str,
    variant: str,
) -> Iterator[RegionComparison]:
    """Yield what changed on the frames with most shadow, and on the others.

    True shadow counts where the log has it, else what both results detected alike; without either,
    or where all frames have as much, there is nothing to tell apart.

    Parameters
    ----------
    base, new
        The mask's counts by region.
    rates
        Its rows of ``frames.csv`` in both results, on the same frames as the counts.
    """
    before, after = rates
    known = (name for name in SHADOWS if name in base and name in new)
    alike = [name for name in known if base[name].has_the_pixels_of(new[name])]
    if not alike:
        return
    share = base[alike[0]].pixels / np.maximum(before["N"], 1)
    much = share >= max(np.sort(share)[-max(round(SHADED * len(share)), 1)], 1e-9)
    for name, title, here in (
        ("frames_with_shadow", "frames with most shadow", much),
        ("other_frames", "the other frames", ~much),
    ):
        if not much.any() or much.all():
            return
        one, other = before["ERR"][here], after["ERR"][here]
        difference = mean_difference(other, one, settings)
        yield _compared(result, variant, name, title, rates=(one, other), difference=difference)


def _compared(
    result: str,
    variant: str,
    region: str,
    title: str,
    *,
    rates: tuple[Floats, Floats],
    difference: Difference,
) -> RegionComparison:
    """Return a row of the ERR of both masks on the same frames, ``(n,)`` each and defined."""
    base, new = rates
    return RegionComparison(
        result=result,
        variant=variant,
        region=region,
        title=title,
        frames=len(base),
        base=float(base.mean()),
        new=float(new.mean()),
        difference=difference,
    )


def disagreements(table: Rows, frames: Rows, base: str, new: str) -> Iterator[Disagreement]:
    """Yield the frames on which two variants of a run disagree most; of neighbours only one.

    Parameters
    ----------
    table
        The rows of ``disagreements.csv``.
    frames
        Rows with the frames' stamps.
    base, new
        The variants.
    """
    pairs = ((base, new, "repaired", "spoiled"), (new, base, "spoiled", "repaired"))
    stamps = dict(zip(frames["frame"].tolist(), frames["stamp_ns"].tolist(), strict=True))
    for one, other, new_right, base_right in pairs:
        own = table.take((table["from_variant"] == one) & (table["to_variant"] == other))
        own = own.take(np.isin(own["frame"], [*stamps]) & (own["N"] > 0))
        if not len(own):
            continue
        mine, theirs = own[new_right] / own["N"], own[base_right] / own["N"]
        times = np.array([stamps[number] for number in own["frame"].tolist()], np.int64)
        for place in scored.most_changed(times, mine + theirs, MOST, harmed=True).tolist():
            yield Disagreement(
                result=new,
                variant=new,
                frame=int(own["frame"][place]),
                stamp_ns=int(times[place]),
                base_right=float(theirs[place]),
                new_right=float(mine[place]),
            )
