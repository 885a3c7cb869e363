"""Slices: frames, or parts of the image, in which a mask errs more; found, and then confirmed.

A slice has at most two conditions: a measured quantity beyond a limit, a tag, a part of the image.
Slices are searched on one half of a drive's blocks, or of the groups of drives, and the clearest
are tested on the other half. A block is long enough to be nearly independent of its neighbours: a
drive whose errors change slowly is cut into two.

A drive's frames resemble each other, and so do their conditions. The difference of ERR inside and
outside is a weighted sum of the frames' ERR, whose variance `mean_distribution` computes for these
weights; pixels of one frame are compared as pairs. The errors that it models are halfway between
those as they are and those without the difference: as they are, a real difference looks like slow
errors; without it, slow errors look less slow. In a part of the image under a condition, ERR must
also be higher than in the part without the condition, and than beside the part. Groups of drives
are independent: the contributions to a ratio of ERR inside to outside are tested by sign flips
[1]_. An interval has the ratios that are not rejected.

References
----------
.. [1] J. Hemerik, J. J. Goeman, L. Finos, Robust testing in generalized linear models by sign
   flipping score contributions, Journal of the Royal Statistical Society B 82, 2020, 841-864.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from roadeval.data.arrays import Flags, Floats
from roadeval.evaluation.stats.autocorrelation import mean_distribution
from roadeval.evaluation.stats.difference import LEAST_GROUPS, Difference, holm, p_value

if TYPE_CHECKING:
    import pandas as pd

Unit = Literal["frames", "drives"]
LEAST_FRAMES: Final = 40
"""Frames of a drive that a search needs."""
LEAST_INSIDE: Final = {"frames": 10, "drives": 4}
"""Frames, or groups of drives, that each half needs inside a slice, and outside."""
BLOCKS: Final = 8
"""Most blocks of a drive."""
INDEPENDENT: Final = 20
"""Independent frames that a drive needs, and each block if there are more than two."""
QUANTILES: Final = (0.2, 0.4, 0.6, 0.8)
"""Quantiles of a quantity on the searching half at which its limits lie."""
BEST: Final = 12
"""Conditions that are combined with all others."""
LEAST_RATIO: Final = 1.25
"""Least ratio that is worth a sentence, on both halves."""
GAIN: Final = 1.1
"""Factor by which two conditions must have a higher ratio than each of them alone."""
SURE: Final = 0.05
"""Greatest p-value on the searching half of what is tested on the other."""
TRIED: Final = 20
"""Most slices of each kind that are looked at closely."""
TESTED_SLICES: Final = 2
"""Most slices that are tested, of whole frames and of parts of the image each."""
OVERLAP: Final = 0.5
"""Greatest share of common frames of two slices that are tested."""
SHOWN: Final = 3
ON_CLASS: Final = "on "
"""Prefix of a part that is a class of the truth."""
SCENES: Final = 30
"""Stretches of a drive of which each has at most one of the frames that are shown."""


@dataclass(frozen=True)
class Condition:
    """A condition on a frame."""

    quantity: str
    """A column of ``conditions`` or of tags, ``seconds`` in the drive, ``hour`` of the day."""
    operator: Literal[">", "<", "is"]
    limit: float | str


@dataclass(frozen=True)
class Slice:
    """Frames, or a part of their pixels, with a higher ERR than all others.

    Numbers are of the half that confirms it.
    """

    conditions: list[Condition]
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
    """The frames with the highest ERR inside, of both halves, one a scene or a drive."""
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
        The key of a frame, ``stamp_ns``, and a column for each quantity, numbers or words; over
        drives also ``group``.
    parts
        The key of a frame, ``region``, ``wrong`` and ``N``: wrong and labelled pixels.
    """
    import pandas as pd

    on = ["drive", "camera", "frame"]
    columns = [name for name in map(str, conditions) if name not in (*on, "stamp_ns", "group")]
    words = dict.fromkeys(on[:2], "str")
    table = frames.loc[frames["N"] > 0, [*on, "stamp_ns", "FP", "FN", "N"]].astype(words)
    table = table.merge(conditions.drop(columns="stamp_ns").astype(words), on=on)
    counts = {"": np.column_stack((table["FP"] + table["FN"], table["N"])).astype(float)}
    share = np.ones((len(table), 1))
    if over_drives:  # every drive counts the same
        share = 1 / table.groupby("drive")["N"].transform("sum").to_numpy(float)[:, None]
    if len(parts):
        values = parts.astype({**words, "region": "str"})
        wide = values.pivot_table(["wrong", "N"], on, "region", "sum")
        wide = wide.reindex(pd.MultiIndex.from_frame(table[on])).fillna(0)
        for part, regions in _parts([*map(str, wide.columns.unique(1))]).items():
            pairs = [wide[name][regions].to_numpy(float).sum(axis=1) for name in ("wrong", "N")]
            counts[part] = np.column_stack(pairs)
    counts = {part: pixels * share for part, pixels in counts.items()}
    search = _Search(table, columns, counts, "drives" if over_drives else "frames")
    return search.slices(confidence) if search.enough else []


def _parts(regions: Collection[str]) -> dict[str, list[str]]:
    """Return the regions of each part: distances from near to far, else rows; and all others."""
    matches = filter(None, (re.fullmatch(r"(\d+)-(\d+)m", name) for name in regions))
    ends = sorted((int(match[1]), int(match[2])) for match in matches)
    names = [f"{near}-{far}m" for near, far in ends]
    parts = {names[0]: names[:1]} if ends else {}
    for place, (near, _) in enumerate(ends[1:], 1):
        parts[f"{near}-{ends[-1][1]}m"] = names[place:]
    bands = [name for name in regions if name.startswith("band_")]
    for band in bands if not ends else ():
        first, last = (100 * (int(band[5:]) + more) // len(bands) for more in (0, 1))
        parts[f"rows_{first}-{last}"] = [band]
    return parts | {name: [name] for name in regions if name not in (*names, *bands)}


class _Search:
    """The frames of a mask with their conditions, and their counts by part, ``(n, 2)`` each."""

    def __init__(
        self, table: pd.DataFrame, columns: Sequence[str], counts: Mapping[str, Floats], unit: Unit
    ) -> None:
        self._table, self._columns, self._counts, self._unit = table, columns, counts, unit
        self.enough, count = False, len(table)
        self._block = np.zeros(count, np.int64)
        if unit == "drives":
            self._block = table["group"].factorize()[0]
            self._drive = table["drive"].factorize()[0]
            self.enough = len(np.unique(self._block)) >= 2 * LEAST_GROUPS
        elif count >= LEAST_FRAMES:
            wrong, pixels = counts[""].T
            independent = mean_distribution(wrong / pixels).effective
            blocks = 2 * int(np.clip(independent / (2 * INDEPENDENT), 1, BLOCKS // 2))
            self._block = np.arange(count) * blocks // count
            self.enough = independent >= INDEPENDENT
        self._searching = self._block % 2 == 0

    def slices(self, confidence: float) -> list[Slice]:
        """Return the slices that are found and confirmed."""
        conditions = [*self._conditions()]
        meets = np.array([np.ones(len(self._table), bool), *(flags for _, flags in conditions)])
        family, chosen = [], [*self._choose(meets)]
        for flags, part, _ in chosen:
            p, ratio = self._test(flags, part, ~self._searching)
            count = int((flags & ~self._searching).sum())
            family.append(Difference(math.log(ratio), None, None, p, confidence, self._unit, count))
        slices = []
        for (flags, part, places), tested in zip(chosen, holm(family), strict=True):
            ratio, p_holm = math.exp(tested.mean), tested.p_holm
            if p_holm is None or p_holm >= 1 - confidence or ratio < LEAST_RATIO:
                continue
            sums = self._sums(flags, part, ~self._searching)
            inside, outside = (float(side[:, 0].sum() / side[:, 1].sum()) for side in sums)
            low, high = self._interval(*sums, ratio, confidence)
            of = [conditions[place - 1][0] for place in places if place]
            worst_frames, drives = self._worst(flags, part)
            slices.append(
                Slice(
                    *(of, part, tested.units, inside, outside, ratio, low, high, p_holm),
                    worst_frames,
                    drives,
                )
            )
        return sorted(slices, key=lambda failure: -failure.ratio)

    def _conditions(self) -> Iterator[tuple[Condition, Flags]]:
        """Yield conditions, and whether each frame meets them."""
        for name in self._columns:
            column = self._table[name]
            if column.dtype.kind not in "fiu":
                for word in sorted(column.dropna().unique()):
                    yield Condition(name, "is", str(word)), (column == word).to_numpy(bool)
                continue
            values = column.to_numpy(float)
            known = values[self._searching & np.isfinite(values)]
            limits = np.quantile(known, QUANTILES) if len(known) else ()
            for limit in dict.fromkeys(float(f"{limit:.2g}") for limit in limits):
                yield Condition(name, ">", limit), values > limit
                yield Condition(name, "<", limit), values < limit

    def _choose(self, meets: Flags) -> Iterator[tuple[Flags, str, tuple[int, ...]]]:
        """Yield the clearest slices of the searching half: flags, part and conditions' places."""
        scores, ratios = self._score(meets, "")
        of_frames: list[tuple[float, str, tuple[int, ...]]]
        of_frames = [(scores[place], "", (place,)) for place in range(len(meets))]
        of_parts = []
        for first in np.argsort(-scores, kind="stable")[:BEST].tolist():
            both, both_ratios = self._score(meets & meets[first], "")
            better = np.flatnonzero(both_ratios >= GAIN * np.maximum(ratios, ratios[first]))
            of_frames += [(both[place], "", (first, place)) for place in better.tolist()]
        for part in [*self._counts][1:]:
            both, both_ratios = self._score(meets, part)
            better = both_ratios >= GAIN * np.maximum(ratios, both_ratios[0])
            places = np.flatnonzero(better).tolist()
            places += [0] * (not part.startswith(ON_CLASS))  # the table of classes tells it
            of_parts += [(both[place], part, (place,)) for place in places]
        for candidates in (of_frames, of_parts):
            taken: list[tuple[Flags, str]] = []
            ranked = sorted(candidates, key=lambda candidate: -candidate[0])
            for score, part, conditions in ranked[:TRIED]:
                if score <= 0 or len(taken) == TESTED_SLICES:
                    break
                flags: Flags = np.logical_and.reduce(meets[[*conditions]])
                if any(part == other and _share(flags, f) > OVERLAP for f, other in taken):
                    continue
                p_searched, ratio = self._test(flags, part, self._searching)
                if p_searched <= SURE and ratio >= LEAST_RATIO:
                    taken.append((flags, part))
                    yield flags, part, conditions

    def _score(self, meets: Flags, part: str) -> tuple[Floats, Floats]:
        """Return a quick score, and the ratio, of each row of flags on the searching half.

        Both are 0 if the slice, or the rest, is too small, or errs less than the rest.
        """
        rows = self._searching
        units = self._drive if self._unit == "drives" else np.arange(len(rows)) * 40 // len(rows)
        starts = np.flatnonzero(np.diff(units[rows], prepend=-1))
        flags, (wrong, pixels) = meets[:, rows], self._counts[part][rows].T
        errors, labelled = (np.add.reduceat(flags * c, starts, axis=1) for c in (wrong, pixels))
        rest, rest_labelled = (
            np.add.reduceat(c, starts) - sums
            for c, sums in zip(self._counts[""][rows].T, (errors, labelled), strict=True)
        )
        if self._unit == "drives":
            errors, labelled, rest, rest_labelled = _within_drives(
                errors, labelled, rest, rest_labelled
            )
        common = (errors + rest).sum(axis=1) / (labelled + rest_labelled).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            series = (errors - common[:, None] * labelled) / labelled.sum(axis=1, keepdims=True)
            series -= (rest - common[:, None] * rest_labelled) / rest_labelled.sum(
                axis=1, keepdims=True
            )
            scores = series.sum(axis=1) / np.sqrt((series**2).sum(axis=1))
            ratios = errors.sum(axis=1) / labelled.sum(axis=1)
            ratios /= rest.sum(axis=1) / rest_labelled.sum(axis=1)
        usable = np.isfinite(scores) & np.isfinite(ratios) & (ratios > 1)
        return np.where(usable, scores, 0), np.where(usable, ratios, 0)

    def _sums(self, flags: Flags, part: str, rows: Flags) -> tuple[Floats, Floats]:
        """Return wrong and labelled pixels inside and outside, by frame or group of a half."""
        inside = np.where(flags[rows, None], self._counts[part][rows], 0)
        outside = self._counts[""][rows] - inside
        if self._unit == "frames":
            return inside, outside
        _, first, drive = np.unique(self._drive[rows], return_index=True, return_inverse=True)
        sums: list[Floats] = [np.bincount(drive, c).astype(float) for c in (*inside.T, *outside.T)]
        group = np.unique(self._block[rows][first], return_inverse=True)[1]
        counts = np.array([np.bincount(group, column) for column in _within_drives(*sums)])
        counts = counts[:, (counts[1] > 0) | (counts[3] > 0)].T
        return counts[:, :2], counts[:, 2:]

    def _test(self, flags: Flags, part: str, rows: Flags) -> tuple[float, float]:
        """Return the p-value of a slice on a half, and its ratio; 1 and 1 if it is too small."""
        pairs = [self._sums(flags, part, rows)]
        if part and self._unit == "frames" and not flags[rows].all():
            counts, beside = (
                self._counts[part][rows],
                self._counts[""][rows] - self._counts[part][rows],
            )
            there, seen = flags[rows], counts[:, 1] > 0
            pairs.append((counts[there], beside[there]))
            pairs.append((counts[seen] * there[seen, None], counts[seen] * ~there[seen, None]))
        p, ratios = 0.0, []
        for inside, outside in pairs:
            units = min((side[:, 1] > 0).sum() for side in (inside, outside))
            if (
                units < LEAST_INSIDE[self._unit]
                or not inside[:, 0].sum()
                or not outside[:, 0].sum()
            ):
                return 1.0, 1.0
            p = max(p, _p_value(inside, outside, self._unit))
            (wrong, pixels), (wrong_outside, rest) = inside.sum(axis=0), outside.sum(axis=0)
            ratios.append(float(wrong / pixels / (wrong_outside / rest)))
        return (p, ratios[0]) if min(ratios) > 1 else (1.0, 1.0)

    def _interval(
        self, inside: Floats, outside: Floats, ratio: float, confidence: float
    ) -> tuple[float, float]:
        """Return the least and the greatest ratio that is not rejected, to half a percent."""
        ends = []
        for end in (1.0, 20 * ratio):
            near, far = ratio, end
            while abs(math.log(far / near)) > 0.005:
                middle = math.sqrt(near * far)
                rejected = _p_value(inside, outside, self._unit, middle) < 1 - confidence
                near, far = (near, middle) if rejected else (middle, far)
            ends.append(near)
        return ends[0], ends[1]

    def _worst(self, flags: Flags, part: str) -> tuple[list[int], list[str]]:
        """Return the frames with the highest ERR inside; and their drives, if there are several."""
        wrong, pixels = self._counts[part].T
        rates = np.divide(wrong, pixels, out=np.zeros(len(wrong)), where=pixels > 0)
        scene = np.arange(len(wrong)) * SCENES // len(wrong)
        of_drives = self._unit == "drives"
        rows = self._table.assign(error=rates, scene=self._block if of_drives else scene)[flags]
        rows = rows.sort_values("error", ascending=False, kind="stable")
        rows = rows.drop_duplicates("scene")[:SHOWN]
        return rows["frame"].tolist(), rows["drive"].tolist() if of_drives else []


def _within_drives(
    wrong: Floats, pixels: Floats, rest: Floats, rest_pixels: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return wrong and labelled pixels inside and outside, ``(..., drives)``, weighted.

    The weights are those of Mantel and Haenszel, so that each drive is compared with itself. What
    no drive has both inside and outside, as a tag, is compared between drives, without weights.
    """
    both = pixels + rest_pixels
    weights = pixels * rest_pixels / both
    alone = weights.sum(axis=-1, keepdims=True) == 0
    return (
        np.where(alone, wrong, wrong * rest_pixels / both),
        np.where(alone, pixels, weights),
        np.where(alone, rest, rest * pixels / both),
        np.where(alone, rest_pixels, weights),
    )


def _p_value(inside: Floats, outside: Floats, unit: Unit, ratio: float = 1.0) -> float:
    """Return the p-value of a ratio of ERR inside to outside, from pixels by unit, ``(n, 2)``."""
    (wrong, pixels), (rest, rest_pixels) = inside.T, outside.T
    shares, rest_shares = pixels / pixels.sum(), rest_pixels / rest_pixels.sum()
    if unit == "drives":
        wrong = wrong / ratio
    else:
        away = math.log(wrong.sum() / pixels.sum() / (rest.sum() / rest_pixels.sum()) / ratio)
        wrong = wrong / (ratio * math.exp(away / 2))
    common = (wrong + rest).sum() / (pixels + rest_pixels).sum()
    if unit == "frames" and not (pixels * rest_pixels).any():  # whole frames
        errors = (wrong + rest) / (pixels + rest_pixels) / common
        mean = mean_distribution(errors, factors=shares - rest_shares)
        return mean._replace(mean=away).p_value()
    series = wrong / pixels.sum() - rest / rest_pixels.sum() - common * (shares - rest_shares)
    series *= len(series) / common
    if unit == "frames":
        return mean_distribution(series)._replace(mean=away).p_value()
    return p_value(series, unit)


def _share(one: Flags, other: Flags) -> float:
    """Return the share of frames in either that are in both."""
    return float((one & other).sum() / max((one | other).sum(), 1))
