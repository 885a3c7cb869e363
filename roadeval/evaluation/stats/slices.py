"""Slices: frames, or parts of the image, with a higher ERR; first searched, then confirmed.

A slice has at most two conditions: a measured quantity beyond a limit, a tag, a part of the image.
Slices are searched on one half of a drive's blocks, or of the groups of drives, and the clearest
are tested on the other half. A block is long enough to be nearly independent of its neighbours: if
errors change slowly, a drive has only two blocks.

A drive's frames resemble each other, and so do their conditions. The difference of ERR inside and
outside is a weighted sum of the frames' ERR. `mean_distribution` computes its variance for these
weights; pixels of one frame are compared as pairs. Errors are modelled with half of the difference:
with all of it, a real difference looks like slow errors; without it, slow errors look less slow. In
a part of the image under a condition, ERR must also be higher than in the part without the
condition, and higher than in the rest of the image. Groups of drives
are independent: the contributions to a ratio of ERR inside to outside are tested by sign flips
[1]_. An interval contains the ratios that are not rejected.

References
----------
.. [1] J. Hemerik, J. J. Goeman, L. Finos, Robust testing in generalized linear models by sign
   flipping score contributions, Journal of the Royal Statistical Society B 82, 2020, 841-864.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from roadeval.data.arrays import Flags, Floats, Places
from roadeval.evaluation.stats.autocorrelation import mean_distribution
from roadeval.evaluation.stats.difference import LEAST_GROUPS, Difference, holm, p_value

if TYPE_CHECKING:
    import pandas as pd

Unit = Literal["frames", "drives"]
LEAST_FRAMES: Final = 40
"""Least number of frames of a drive for a search."""
LEAST_INSIDE: Final = {"frames": 10, "drives": 4}
"""Least number of frames, or of groups of drives, inside and outside a slice on each half."""
BLOCKS: Final = 8
"""Greatest number of blocks of a drive."""
INDEPENDENT: Final = 20
"""Least number of independent frames in a drive, and in each block if there are more than two."""
QUANTILES: Final = (0.2, 0.4, 0.6, 0.8)
"""Quantiles of a quantity, on the searching half, that become its limits."""
BEST: Final = 12
"""Number of conditions that are combined with all others."""
LEAST_RATIO: Final = 1.25
"""Least ratio that is worth a sentence, on both halves."""
GAIN: Final = 1.1
"""Least ratio of two conditions together, as a multiple of the ratio of each alone."""
SURE: Final = 0.05
"""Greatest p-value on the searching half with which a slice is tested on the other half."""
TRIED: Final = 20
"""Greatest number of slices of each kind that are looked at closely."""
TESTED_SLICES: Final = 2
"""Greatest number of slices that are tested, both of whole frames and of parts of the image."""
OVERLAP: Final = 0.5
"""Greatest share of common frames of two slices that are tested."""
SHOWN: Final = 3
"""Number of worst frames of a slice."""
ON_CLASS: Final = "on "
"""Prefix of a part that is a class of the truth."""
OF_REGIONS: Final = r"band_|\d"
"""Beginnings of the parts that are also regions: bands of rows, and distances."""
SCENES: Final = 30
"""Number of stretches of a drive; at most one frame of each is shown."""


@dataclass(frozen=True)
class FrameCondition:
    """A condition on a frame."""

    quantity: str
    """A column of ``conditions`` or of tags, ``seconds`` in the drive, ``hour`` of the day."""
    operator: Literal[">", "<", "is"]
    limit: float | str


@dataclass(frozen=True)
class Slice:
    """Frames, or a part of their pixels, with a higher ERR than all others.

    Its numbers come from the confirming half.
    """

    conditions: list[FrameCondition]
    part: str
    """The part of the image: ``20-80m`` ahead, ``rows_40-60`` in percent from the top, ``left``,
    ``right``, ``on <class>`` of the truth; empty for whole frames."""
    frames: int
    inside: float
    outside: float
    """ERR of all labelled pixels inside and outside."""
    ratio: float
    low: float
    high: float
    """ERR inside divided by ERR outside, with its interval."""
    p_holm: float
    worst: list[int] = field(default_factory=list)
    """The frames with the highest ERR inside, of both halves, one for each scene or drive."""
    drives: list[str] = field(default_factory=list)
    """The drives of these frames; empty within one drive."""


def find_slices(
    frames: pd.DataFrame,
    conditions: pd.DataFrame,
    parts: pd.DataFrame,
    confidence: float,
    *,
    over_drives: bool = False,
) -> list[Slice]:
    """Return the slices that hold on the confirming half, the highest ratio first.

    Parameters
    ----------
    frames
        The rows of ``frames`` of one final mask, in order.
    conditions
        A row for each frame: its key, ``stamp_ns``, and a column for each quantity, numbers or
        words; over drives also ``group``.
    parts
        A row for each frame and part: its key, ``region``, ``wrong`` pixels, ``N`` labelled ones.
    """
    import pandas as pd

    on = ["drive", "camera", "frame"]
    columns = [name for name in map(str, conditions) if name not in (*on, "stamp_ns", "group")]
    words = dict.fromkeys(on[:2], "str")
    table = frames.loc[frames["N"] > 0, [*on, "FP", "FN", "N"]].astype(words)
    table = table.merge(conditions.astype(words), on=on)
    pixels = {"": np.array([table["FP"] + table["FN"], table["N"]], float)}
    if len(parts):
        values = parts.astype({**words, "region": "str"})
        wide = values.pivot_table(["wrong", "N"], on, "region", "sum")
        wide = wide.reindex(pd.MultiIndex.from_frame(table[on])).fillna(0)
        regions = [*map(str, wide.columns.unique(1))]
        matches = filter(None, (re.fullmatch(r"(\d+)-(\d+)m", name) for name in regions))
        ends = sorted((int(match[1]), int(match[2])) for match in matches)
        distances = [f"{near}-{far}m" for near, far in ends]
        bands = [name for name in regions if name.startswith("band_")]
        regions_of = {distances[0]: distances[:1]} if ends else {}
        for place, (near, _) in enumerate(ends[1:], 1):
            regions_of[f"{near}-{ends[-1][1]}m"] = distances[place:]
        for band in bands if not ends else ():  # rows replace unknown distances
            first, last = (100 * (int(band[5:]) + more) // len(bands) for more in (0, 1))
            regions_of[f"rows_{first}-{last}"] = [band]
        regions_of |= {name: [name] for name in regions if name not in (*distances, *bands)}
        for part, names in regions_of.items():
            sums = [wide[n][names].to_numpy(float).sum(axis=1) for n in ("wrong", "N")]
            pixels[part] = np.array(sums)
    if over_drives:  # all drives have equal weights
        of_drive = table.groupby("drive")["N"].transform("sum").to_numpy(float)
        pixels = {part: counts * (1 / of_drive) for part, counts in pixels.items()}
    search = _Search(table, columns, pixels, "drives" if over_drives else "frames")
    return search.slices(confidence)


class _Search:
    """The frames of a mask with their conditions, and wrong and labelled ``pixels`` by part.

    ``pixels`` are ``(2, n)``. ``sides`` are ``(4, ..., units)``: wrong pixels inside and outside,
    and labelled ones inside and outside, by frame, stretch, drive or group.
    """

    def __init__(
        self, table: pd.DataFrame, columns: Sequence[str], pixels: Mapping[str, Floats], unit: Unit
    ) -> None:
        self._table, self._columns, self._pixels, self._unit = table, columns, pixels, unit
        self._frames = self._units = np.arange(len(table))
        if unit == "drives":
            self._units, self._block = (table[n].factorize()[0] for n in ("drive", "group"))
            self._enough = table["group"].nunique() >= 2 * LEAST_GROUPS
        elif len(table) < LEAST_FRAMES:
            self._block, self._enough = self._frames, False
        else:
            wrong, labelled = pixels[""]
            independent = mean_distribution(wrong / labelled).effective
            blocks = 2 * int(np.clip(independent / (2 * INDEPENDENT), 1, BLOCKS // 2))
            self._block, self._enough = self._stretches(blocks), independent >= INDEPENDENT
        self._searching = self._block % 2 == 0

    def _stretches(self, count: int) -> Places:
        """Return the number of each frame's stretch, ``(n,)``, of ``count`` with equal length."""
        return self._frames * count // len(self._frames)

    def slices(self, confidence: float) -> list[Slice]:
        """Return the slices of the searching half that the other half confirms."""
        if not self._enough:
            return []
        conditions, flags_by_condition = zip(*self._conditions(), strict=True)
        chosen = [*self._choose(np.array(flags_by_condition))]
        tests = [self._test(flags, part, ~self._searching) for flags, part, _ in chosen]
        family = [Difference(math.nan, None, None, p, confidence, self._unit, 0) for p, _ in tests]
        slices = []
        for (flags, part, places), (_, sides), tested in zip(
            chosen, tests, holm(family), strict=True
        ):
            p = tested.p_holm
            if p is None or p >= 1 - confidence or _ratios(sides) < LEAST_RATIO:
                continue
            met = [c for place in places if (c := conditions[place])]
            frames = int((flags & ~self._searching).sum())
            wrong, rest, labelled, rest_labelled = sides.sum(axis=-1).tolist()
            rates, ratio = (wrong / labelled, rest / rest_labelled), float(_ratios(sides))
            ends, worst = self._interval(sides, ratio, confidence), self._worst(flags, part)
            slices.append(Slice(met, part, frames, *rates, ratio, *ends, p, *worst))
        return sorted(slices, key=lambda confirmed: -confirmed.ratio)

    def _conditions(self) -> Iterator[tuple[FrameCondition | None, Flags]]:
        """Yield None for all frames, then each condition, with flags of the frames that meet it."""
        yield None, np.ones(len(self._table), bool)
        for name in self._columns:
            column = self._table[name]
            if column.dtype.kind not in "fiu":
                for word in sorted(column.dropna().unique()):
                    yield FrameCondition(name, "is", str(word)), (column == word).to_numpy(bool)
                continue
            values = column.to_numpy(float)
            measured = values[self._searching & np.isfinite(values)]
            limits = np.quantile(measured, QUANTILES) if len(measured) else ()
            for limit in dict.fromkeys(float(f"{limit:.2g}") for limit in limits):
                yield FrameCondition(name, ">", limit), values > limit
                yield FrameCondition(name, "<", limit), values < limit

    def _choose(self, meets: Flags) -> Iterator[tuple[Flags, str, tuple[int, ...]]]:
        """Yield the clearest slices of the searching half: flags, part, places of conditions."""
        scores, ratios = self._score(meets, "")
        of_frames: list[tuple[float, str, tuple[int, ...]]]
        of_frames = [(score, "", (place,)) for place, score in enumerate(scores.tolist())]
        of_parts = []
        for first in np.argsort(-scores, kind="stable")[:BEST].tolist():
            both, both_ratios = self._score(meets & meets[first], "")
            better = np.flatnonzero(both_ratios >= GAIN * np.maximum(ratios, ratios[first]))
            of_frames += [(both[place], "", (first, place)) for place in better.tolist()]
        for part in [*self._pixels][1:]:
            both, both_ratios = self._score(meets, part)
            better = both_ratios >= GAIN * np.maximum(ratios, both_ratios[0])
            better[0] = not part.startswith(ON_CLASS)  # the table of classes tells it
            of_parts += [(both[place], part, (place,)) for place in np.flatnonzero(better).tolist()]
        for candidates in (of_frames, of_parts):
            taken: list[tuple[Flags, str]] = []
            for score, part, places in sorted(candidates, key=lambda c: -c[0])[:TRIED]:
                if score <= 0 or len(taken) == TESTED_SLICES:
                    break
                flags = np.logical_and.reduce(meets[[*places]])
                if any(
                    part == other and (flags & others).sum() > OVERLAP * (flags | others).sum()
                    for others, other in taken
                ):
                    continue
                p, sides = self._test(flags, part, self._searching)
                if p <= SURE and _ratios(sides) >= LEAST_RATIO:
                    taken.append((flags, part))
                    yield flags, part, places

    def _score(self, meets: Flags, part: str) -> tuple[Floats, Floats]:
        """Return a quick score and the ratio of each row of flags on the searching half.

        Both are 0 if the slice or the rest is empty, or ERR inside is not higher.
        """
        units = self._units if self._unit == "drives" else self._stretches(40)
        sides = self._sides(meets, part, self._searching, units)
        with np.errstate(divide="ignore", invalid="ignore"):
            series, ratios = _contributions(sides)[0], _ratios(sides)
            scores = series.sum(axis=1) / np.sqrt((series**2).sum(axis=1))
        usable = np.isfinite(scores) & np.isfinite(ratios) & (ratios > 1)
        return np.where(usable, scores, 0), np.where(usable, ratios, 0)

    def _sides(self, flags: Flags, part: str, rows: Flags, units: Places, pool: str = "") -> Floats:
        """Return the sides: ``part`` under ``flags`` is inside, the rest of part ``pool`` outside.

        Over drives they are weighted, see `_within_drives`.
        """
        starts = np.flatnonzero(np.diff(units[rows], prepend=-1))
        sides = []
        for pixels, everywhere in zip(self._pixels[part], self._pixels[pool], strict=True):
            inside = flags[..., rows] * pixels[rows]
            outside = everywhere[rows] - inside
            sides += [np.add.reduceat(side, starts, axis=-1) for side in (inside, outside)]
        return _within_drives(*sides) if self._unit == "drives" else np.array(sides)

    def _test(self, flags: Flags, part: str, rows: Flags) -> tuple[float, Floats]:
        """Return the p-value of a slice on a half, or 1 if it is too small, and its sides."""
        sides = self._sides(flags, part, rows, self._units)
        if self._unit == "drives":
            first = np.flatnonzero(np.diff(self._units[rows], prepend=-1))
            sides = np.array([np.bincount(self._block[rows][first], side) for side in sides])
            sides = sides[:, (sides[2] > 0) | (sides[3] > 0)]
        comparisons = [sides]
        if part and self._unit == "frames" and not flags[rows].all():
            seen = rows & (self._pixels[part][1] > 0)
            comparisons.append(self._sides(flags, part, rows & flags, self._units))
            comparisons.append(self._sides(flags, part, seen, self._units, part))
        for wrong, rest, labelled, rest_labelled in comparisons:
            least = min((labelled > 0).sum(), (rest_labelled > 0).sum())
            if least < LEAST_INSIDE[self._unit] or not wrong.any() or not rest.any():
                return 1.0, sides
        if min(map(_ratios, comparisons)) <= 1:
            return 1.0, sides
        return max(_p_value(compared, self._unit) for compared in comparisons), sides

    def _interval(self, sides: Floats, ratio: float, confidence: float) -> tuple[float, float]:
        """Return the least and the greatest ratio that are not rejected, to half a percent."""
        ends = []
        for end in (1.0, 20 * ratio):
            near, far = ratio, end
            while abs(math.log(far / near)) > 0.005:
                middle = math.sqrt(near * far)
                rejected = _p_value(sides, self._unit, middle) < 1 - confidence
                near, far = (near, middle) if rejected else (middle, far)
            ends.append(near)
        return ends[0], ends[1]

    def _worst(self, flags: Flags, part: str) -> tuple[list[int], list[str]]:
        """Return the frames with the highest ERR inside, and their drives if there are several."""
        wrong, labelled = self._pixels[part]
        rates = np.divide(wrong, labelled, out=np.zeros(len(wrong)), where=labelled > 0)
        of_drives = self._unit == "drives"
        scene = self._block if of_drives else self._stretches(SCENES)
        rows = self._table.assign(error=rates, scene=scene)[flags]
        rows = rows.sort_values("error", ascending=False, kind="stable")
        rows = rows.drop_duplicates("scene")[:SHOWN]
        return rows["frame"].tolist(), rows["drive"].tolist() if of_drives else []


def _within_drives(wrong: Floats, rest: Floats, labelled: Floats, rest_labelled: Floats) -> Floats:
    """Return sides by drive, weighted.

    The weights are Mantel and Haenszel's, so that each drive is compared with itself. If no
    drive has pixels both inside and outside, for example with a tag, drives are compared with each
    other, without weights.
    """
    sides, both = np.array([wrong, rest, labelled, rest_labelled]), labelled + rest_labelled
    weighted = sides * [rest_labelled, labelled, rest_labelled, labelled] / both
    alone = weighted[2].sum(axis=-1, keepdims=True) == 0
    return np.where(alone, sides, weighted)


def _ratios(sides: Floats) -> Floats:
    """Return ERR inside divided by ERR outside."""
    wrong, rest, labelled, rest_labelled = sides.sum(axis=-1)
    return np.asarray(wrong / labelled / (rest / rest_labelled))


def _contributions(sides: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the units' contributions to the difference of ERR, their factors, and total ERR."""
    wrong, rest, labelled, rest_labelled = sides
    *_, inside, outside = sides.sum(axis=-1, keepdims=True)
    common = (wrong + rest).sum(axis=-1, keepdims=True) / (inside + outside)
    factors = labelled / inside - rest_labelled / outside
    series = wrong / inside - rest / outside - common * factors
    return series * (series.shape[-1] / common), factors, common


def _p_value(sides: Floats, unit: Unit, ratio: float = 1.0) -> float:
    """Return the p-value of the hypothesis that ERR inside is ``ratio`` times ERR outside."""
    away = math.log(_ratios(sides) / ratio)
    modelled = ratio if unit == "drives" else ratio * math.exp(away / 2)
    sides = np.array([sides[0] / modelled, *sides[1:]])
    series, factors, common = _contributions(sides)
    if unit == "drives":
        return p_value(series, unit)
    wrong, rest, labelled, rest_labelled = sides
    if (labelled * rest_labelled).any():
        mean = mean_distribution(series)
    else:  # whole frames
        errors = (wrong + rest) / (labelled + rest_labelled) / common
        mean = mean_distribution(errors, factors=factors)
    return mean._replace(mean=away).p_value()
