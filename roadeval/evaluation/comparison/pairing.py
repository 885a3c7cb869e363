"""Pairs: the drives and frames that two results have in common, and where their masks differ."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Rows
from roadeval.data.words import first_of
from roadeval.evaluation import metrics
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.regions import titles
from roadeval.evaluation.score import TESTED, FourCounts, counts_of, most_changed, stages_of

Places = npt.NDArray[np.intp]
Rates = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A drive in a result, or one of its cameras. Its tables are read when they are asked for."""

    drive: str
    """Its identity in the result."""
    name: str
    """Its name for people."""
    digest: str | None
    """What tells the log from another, None where the result does not know it."""
    scored: bool
    """Whether any frame of it was."""
    asked: Mapping[str, Any]
    """Settings that may change its numbers, by names as ``frames.scale``, where known."""
    rows: Callable[[str], Rows]
    """Returns its rows of ``frames``, ``regions`` or ``disagreements``."""
    group: str | None = None
    """A name shared with other drives of the result, as of a day or a route."""
    camera: str = ""
    """Which camera of the drive."""

    @property
    def key(self) -> tuple[str, str]:
        """Its drive and its camera."""
        return self.drive, self.camera


Pair = tuple[Part, Part]
"""A drive in the base and in the new result."""


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One of the results that are compared."""

    label: str
    """What it is called in tables; its own among all."""
    parts: Sequence[Part]
    variants: Mapping[str, str] | None = None
    """What the variants to compare are called here, by their own names; None: all as they are."""

    def rows(self, part: Part, table: str) -> Rows:
        """Return a part's rows of the variants to compare, under the names of the comparison."""
        rows = part.rows(table)
        if self.variants is None:
            return rows
        own = rows.take(np.isin(rows["variant"], [*self.variants]))
        names = [self.variants[name] for name in own["variant"].tolist()]
        return own.replace(variant=np.array(names, str))

    def own_name(self, variant: str) -> str:
        """Return what the result itself calls a variant."""
        named = {name: own for own, name in (self.variants or {}).items()}
        return named.get(variant, variant)

    @property
    def scored(self) -> list[Part]:
        """The drives of which any frame was scored."""
        return [part for part in self.parts if part.scored]


NAMED: Final = 5
"""Drives that are named of those left out; frames of those that changed most, either way, and of
those on which masks disagree."""


def left_out(names: Sequence[str], of: str, why: str) -> str:
    """Return that drives are left out of a result, and why, in a sentence."""
    drives = "1 drive is" if len(names) == 1 else f"{len(names)} drives are"
    return f"{drives} left out of {of} ({why}): {first_of(names, NAMED)}"


def match_drives(base: Side, new: Side) -> tuple[list[Pair], list[str]]:
    """Match the drives of two results, each camera by the drive's name, else by its log.

    One name with two different logs is no match: the difference would be the scene's. Returned are
    the drives that both have scored, in the base's order, and a sentence on all others for each
    result and reason.
    """
    there = {part.key: part for part in new.parts}
    names = {part.key for part in base.parts}
    # A log may be in a result twice.
    logs: defaultdict[tuple[str | None, str], deque[Part]] = defaultdict(deque)
    for part in new.parts:
        if part.key not in names:
            logs[part.digest, part.camera].append(part)
    pairs, taken = [], set()
    left: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for part in base.parts:
        other = there.get(part.key)
        if other is None and part.digest and logs[part.digest, part.camera]:
            other = logs[part.digest, part.camera].popleft()
        if other is not None:
            taken.add(other.key)
        if reason := _why_not(part, other, new.label):
            left[base.label, reason].append(part.name)
        elif other is not None:
            pairs.append((part, other))
    for part in new.parts:
        if part.key not in taken:
            left[new.label, f"not in {base.label}"].append(part.name)
    return pairs, [left_out(names, *about) for about, names in left.items()]


def one_drive(sides: Sequence[Side]) -> list[Side] | None:
    """Return the results with the one drive that is compared; None where several are, or none."""
    base, *others = sides
    pairs = [match_drives(base, new)[0] for new in others]
    firsts = {id(own[0][0]) for own in pairs if own}
    if len(firsts) != 1 or any(len(own) != 1 for own in pairs):
        return None
    parts = [pairs[0][0][0], *(own[0][1] for own in pairs)]
    return [replace(side, parts=[part]) for side, part in zip(sides, parts, strict=True)]


def _why_not(base: Part, new: Part | None, label: str) -> str:
    if new is None:
        return f"not in {label}"
    if not (base.scored and new.scored):
        return "not scored in both"
    if base.digest is None or new.digest is None:
        return "log unknown"
    return "" if base.digest == new.digest else f"of another log in {label}"


@dataclass(frozen=True, slots=True, eq=False)
class MaskPair:
    """A mask's rows in two results of a drive: frames that both have, in the base's order."""

    variant: str
    stage: str
    """What the new result calls the mask."""
    base_stage: str
    final: bool
    """Whether both are the variant's final masks."""
    before: Rows
    after: Rows

    @property
    def counts(self) -> tuple[FourCounts, FourCounts]:
        """``(n, 4)`` each: TP, TN, FP, FN of the base and of the new result."""
        return counts_of(self.before), counts_of(self.after)

    @property
    def rates(self) -> tuple[Rates, Rates]:
        """``(n, m)`` each, in the order of `roadeval.evaluation.metrics.METRICS`."""
        before, after = self.counts
        return metrics.table(before), metrics.table(after)

    @property
    def truth_differs(self) -> npt.NDArray[np.bool_]:
        """Where the truth's road or labelled pixels differ, ``(n,)``."""
        before, after = self.before, self.after
        road = before["TP"] + before["FN"] != after["TP"] + after["FN"]
        return np.asarray(road | (before["N"] != after["N"]))


def common_masks(base: Rows, new: Rows, variant: str | None = None) -> list[MaskPair]:
    """Match the masks of two results of a drive, and their frames by stamp; in the base's order.

    Final masks are matched with final masks, under any stage's name, others by their stage.
    With ``variant`` the base's masks are taken for this variant's.
    """
    last, last_new = stages_of(base), stages_of(new)
    others = {(name, stage): places for name, stage, places in new.masks()}
    found = []
    for name, stage, places in base.masks():
        called, final = variant or name, stage == last[name]
        theirs = last_new.get(called) if final else stage
        if theirs is None or (called, theirs) not in others:
            continue
        if not final and theirs == last_new[called]:
            continue
        own, new_own = base.take(places), new.take(others[called, theirs])
        mine, matching = matched(own["stamp_ns"], new_own["stamp_ns"])
        if len(mine):
            rows = own.take(mine), new_own.take(matching)
            found.append(MaskPair(called, theirs, stage, final, *rows))
    return found


def matched(base: npt.NDArray[np.int64], new: npt.NDArray[np.int64]) -> tuple[Places, Places]:
    """Return the places of the stamps that both have, in the base's order.

    Frames with equal stamps are matched in their order.

    >>> [places.tolist() for places in matched(np.array([5, 7, 7, 9]), np.array([7, 4, 7, 5]))]
    [[0, 1, 2], [3, 0, 2]]
    """
    there: defaultdict[int, deque[int]] = defaultdict(deque)
    for place, stamp in enumerate(new.tolist()):
        there[stamp].append(place)
    pairs = [(n, there[stamp].popleft()) for n, stamp in enumerate(base.tolist()) if there[stamp]]
    mine, theirs = np.array(pairs, np.intp).reshape(-1, 2).T
    return mine, theirs


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


def common_regions(
    base: Mapping[str, FourCounts], new: Mapping[str, FourCounts]
) -> Iterator[tuple[str, npt.NDArray[np.bool_]]]:
    """Yield the regions that are the same pixels in both, with the frames that label any, ``(n,)``.

    Any other, as the shadow that another filter found, is left out: its ERR would describe other
    places.
    """
    for name in titles([*base]):
        known = np.asarray(base[name].any(axis=1))
        if name in new and known.any() and _same_pixels(base[name], new[name]):
            yield name, known


def _same_pixels(base: FourCounts, new: FourCounts) -> bool:
    """Whether two regions may be the same pixels: of each frame as many, and as much road."""
    same = np.array_equal(base.sum(axis=1), new.sum(axis=1))
    return same and np.array_equal(base[:, [0, 3]].sum(axis=1), new[:, [0, 3]].sum(axis=1))
