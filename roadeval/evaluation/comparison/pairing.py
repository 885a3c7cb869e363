"""Pairs: the drives and frames that two results have in common, and where their masks differ."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.data import Rows
from roadeval.data.arrays import Flags, Sums
from roadeval.data.words import first_of
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.regions import titles
from roadeval.evaluation.score import (
    TESTED,
    Camera,
    FourCounts,
    FrameCounts,
    counts_of,
    final_stages,
    most_changed,
)
from roadeval.evaluation.stats import CameraRates

Places = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
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


class MaskPair(NamedTuple):
    """A mask in two results of a drive: the frames that both have, in the base's order."""

    base: FrameCounts
    new: FrameCounts
    final: bool
    """Whether both are their variants' final masks."""

    @property
    def rates(self) -> CameraRates:
        """``(n, m)`` each, in the order of `roadeval.evaluation.metrics.METRICS`."""
        return CameraRates(self.new.stamps, self.new.rates, self.base.rates)


def common_masks(base: Camera, new: Camera) -> list[MaskPair]:
    """Match the masks of two results of a drive, and their frames by stamp; in the base's order.

    Final masks are matched with final masks, under any stage's name, others by their stage.
    """
    last, last_new = (final_stages(mask.name for mask in each) for each in (base, new))
    others, found = {mask.name: mask for mask in new}, []
    for own in base:
        final = own.stage == last[own.variant]
        stage = last_new.get(own.variant, "") if final else own.stage
        other = others.get((own.variant, stage))
        if other is None or (not final and stage == last_new[own.variant]):
            continue
        mine, theirs = matched(own.stamps, other.stamps)
        if len(mine):
            found.append(MaskPair(own.take(mine), other.take(theirs), final))
    return found


_LABELS: Final = np.array([[1, 1], [1, 0], [1, 0], [1, 1]])
"""Makes labelled pixels and road of TP, TN, FP and FN."""


def truth_differs(base: Rows, new: Rows) -> int:
    """Return on how many frames the truth is another, of two results' rows of ``frames``."""
    mine, theirs = (
        rows.take(np.unique(rows["frame"], return_index=True)[1]) for rows in (base, new)
    )
    there, here = matched(mine["stamp_ns"], theirs["stamp_ns"])
    one, other = mine["truth"][there], theirs["truth"][here]
    return int(np.count_nonzero((one != other) & (one != 0) & (other != 0)))  # 0 is unknown


def _labels_differ(base: FourCounts, new: FourCounts) -> Flags:
    """Return on which frames as many pixels are not labelled, or not road, ``(n,)``."""
    return np.asarray((base @ _LABELS != new @ _LABELS).any(axis=1))


def matched(base: Sums, new: Sums) -> tuple[Places, Places]:
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


@dataclass(frozen=True)
class MovedFrame:
    """A frame whose final ERR changed much: that of the base and of the new result."""

    result: str
    variant: str
    frame: int
    stamp_ns: int
    base: float
    new: float
    change: float


@dataclass(frozen=True)
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
    place, own = [*METRICS].index(TESTED), mask.new
    before = mask.base.rates[:, place]
    changes = own.rates[:, place] - before
    for harmed in (True, False):
        for frame in most_changed(own.stamps, changes, NAMED, harmed=harmed).tolist():
            was, change = float(before[frame]), float(changes[frame])
            number, stamp = int(own.frames[frame]), int(own.stamps[frame])
            yield MovedFrame(result, own.variant, number, stamp, was, was + change, change)


def disagreements(table: Rows, mask: FrameCounts, base: str, new: str) -> Iterator[Disagreement]:
    """Yield the frames on which two variants of a run disagree most; of neighbours only one.

    ``table`` has the rows of ``disagreements``; only the frames of ``mask`` are looked at.
    """
    pairs = ((base, new, "repaired", "spoiled"), (new, base, "spoiled", "repaired"))
    stamps = dict(zip(mask.frames.tolist(), mask.stamps.tolist(), strict=True))
    for one, other, new_right, base_right in pairs:
        own = table.take((table["from_variant"] == one) & (table["to_variant"] == other))
        own = own.take(np.isin(own["frame"], mask.frames) & (own["N"] > 0))
        mine, theirs = own[new_right] / own["N"], own[base_right] / own["N"]
        times = np.array([stamps[number] for number in own["frame"].tolist()], np.int64)
        for place in most_changed(times, mine + theirs, NAMED, harmed=True).tolist():
            frame, right = int(own["frame"][place]), (float(theirs[place]), float(mine[place]))
            yield Disagreement(new, new, frame, int(times[place]), *right)


def region_counts(regions: Rows, mask: FrameCounts) -> dict[str, FourCounts]:
    """Return a mask's counts by region, ``(n, 4)`` each; 0 on a frame that the table lacks.

    ``regions`` has the rows of ``regions``; the frames are those of the mask, in any order.
    """
    own = regions.take((regions["variant"] == mask.variant) & (regions["stage"] == mask.stage))
    own = own.take(np.isin(own["frame"], mask.frames))
    order, found = np.argsort(mask.frames), {}
    for name in own.distinct("region"):
        rows = own.take(own["region"] == name)
        places = order[np.searchsorted(mask.frames, rows["frame"], sorter=order)]
        found[name] = np.zeros((len(order), 4), np.int64)
        found[name][places] = counts_of(rows)
    return found


def common_regions(
    base: Mapping[str, FourCounts], new: Mapping[str, FourCounts]
) -> Iterator[tuple[str, Flags]]:
    """Yield the regions that are the same pixels in both, with the frames that label any, ``(n,)``.

    Any other, as the shadow that another filter found, is left out: its ERR would describe other
    places. They may be the same where each frame has as many, and as much road.
    """
    for name in titles([*base]):
        known = np.asarray(base[name].any(axis=1))
        if name in new and known.any() and not _labels_differ(base[name], new[name]).any():
            yield name, known
