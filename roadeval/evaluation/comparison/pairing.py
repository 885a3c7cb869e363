"""The drives and frames that two results have in common, and where their masks differ."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data.words import first_of
from roadeval.errors import RoadevalError
from roadeval.evaluation import tables
from roadeval.evaluation.metrics import METRICS, TESTED
from roadeval.evaluation.tables import COUNTS, KEY, MASK, group_rows, only, pair_rows, rates_of

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class ComparedDrive:
    """A drive in a result, or one of its cameras."""

    drive: str
    """Its identity in the result."""
    camera: str
    name: str
    """Its name for people."""
    digest: str | None
    """Identifies the log; None if the result does not know it."""
    frames: int
    """Number of evaluated frames."""
    settings: Mapping[str, Any]
    """Known settings that may change its numbers, by names such as ``frames.scale``."""
    group: str | None = None
    """A name shared with other drives of the result, for example a day or a route."""

    @property
    def key(self) -> tuple[str, str]:
        """Its drive and its camera."""
        return self.drive, self.camera


@dataclass(frozen=True, eq=False)
class Side:
    """One of the results that are compared."""

    label: str
    """Its name in tables, which no other result has."""
    drives: Sequence[ComparedDrive]
    tables: Callable[[str, Collection[tuple[str, str]]], pd.DataFrame]
    """Returns a table of some drives, given by drive and camera: ``frames``, ``disagreements``, or
    the rows of ``regions`` of final masks."""
    variants: Mapping[str, str] | None = None
    """Name in the comparison of each variant to compare; None keeps all."""

    def table(self, name: str, drives: Collection[tuple[str, str]]) -> pd.DataFrame:
        """Return some drives' rows of the variants to compare, under the comparison's names.

        A mapping of drives gives their keys in the comparison; if one of them differs, drives and
        cameras are text.
        """
        rows = self.tables(name, drives)
        if isinstance(drives, Mapping):
            keys, places = tables.keys_of(rows)
            if unknown := {*keys} - drives.keys():
                key = " ".join(min(unknown))
                raise RoadevalError(f"a table has rows of {key}, which is not compared")
            if any(drives[key] != key for key in keys):
                names = np.array([drives[key] for key in keys], object)[places]
                rows = rows.assign(drive=names[:, 0], camera=names[:, 1])
        if self.variants is None or "variant" not in rows:
            return rows
        rows = rows[rows["variant"].isin([*self.variants])]
        return rows.assign(variant=rows["variant"].astype(str).map(self.variants))

    @property
    def scored(self) -> list[ComparedDrive]:
        """The drives that have a scored frame."""
        return [drive for drive in self.drives if drive.frames]


Pair = tuple[ComparedDrive, ComparedDrive]
"""A drive in the base and in the new result."""
NAMED: Final = 5
"""Greatest number of drives named as left out, and of frames named as changed or disagreeing."""


def left_out(names: Sequence[str], result: str, why: str) -> str:
    """Return a sentence that names the drives left out of a result, and the reason."""
    drives = "1 drive is" if len(names) == 1 else f"{len(names)} drives are"
    return f"{drives} left out of {result} ({why}): {first_of(names, NAMED)}"


def match_drives(base: Side, new: Side) -> tuple[list[Pair], list[str]]:
    """Match the drives of two results, each camera by the drive's name, else by its log.

    Drives with one name but different logs do not match: the scene would make the difference.
    Return the drives that both have scored, in the base's order, and sentences on all others, one
    for each result and reason.
    """
    by_key = {drive.key: drive for drive in new.drives}
    names = {drive.key for drive in base.drives}
    # A log may be in a result twice.
    logs: defaultdict[tuple[str | None, str], deque[ComparedDrive]] = defaultdict(deque)
    for drive in new.drives:
        if drive.key not in names:
            logs[drive.digest, drive.camera].append(drive)
    pairs, taken = [], set()
    left: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for drive in base.drives:
        other = by_key.get(drive.key)
        if other is None and drive.digest and logs[drive.digest, drive.camera]:
            other = logs[drive.digest, drive.camera].popleft()
        if other is None:
            left[base.label, f"not in {new.label}"].append(drive.name)
            continue
        taken.add(other.key)
        reasons = {
            "not scored in both": not (drive.frames and other.frames),
            "log unknown": None in (drive.digest, other.digest),
            f"of another log in {new.label}": drive.digest != other.digest,
        }
        if reason := next((reason for reason, holds in reasons.items() if holds), None):
            left[base.label, reason].append(drive.name)
        else:
            pairs.append((drive, other))
    for drive in new.drives:
        if drive.key not in taken:
            left[new.label, f"not in {base.label}"].append(drive.name)
    return pairs, [left_out(names, *about) for about, names in left.items()]


def one_drive(sides: Sequence[Side]) -> list[Side] | None:
    """Return the results with the one drive that is compared; None if there are none or several."""
    base, *others = sides
    pairs = [match_drives(base, new)[0] for new in others]
    firsts = {matched[0][0].key for matched in pairs if matched}
    if len(firsts) != 1 or any(len(matched) != 1 for matched in pairs):
        return None
    drives = [pairs[0][0][0], *(matched[0][1] for matched in pairs)]
    return [replace(side, drives=[drive]) for side, drive in zip(sides, drives, strict=True)]


def common_masks(base: pd.DataFrame, new: pd.DataFrame) -> pd.DataFrame:
    """Match the masks of two results on the frames that both have, by stamp; in the base's order.

    Arguments are rows of ``frames``. Final masks are matched with final masks, whatever their
    stages are called, other masks by their stage; the column ``final`` tells which they are. The
    base's columns end in ``_base``, and masks have the names of the new result.
    """

    def with_step(table: pd.DataFrame) -> pd.DataFrame:
        final = tables.is_final(table)
        return table.assign(final=final, step=np.where(final, "", table["stage"].astype(str)))

    return pair_rows(
        with_step(base), with_step(new), [*KEY, "variant", "step", "final", "stamp_ns"]
    )


def truth_differs(base: pd.DataFrame, new: pd.DataFrame) -> int:
    """Return the number of frames with different truths, from two results' rows of ``frames``."""
    base, new = (table[~table.duplicated([*KEY, "frame"])] for table in (base, new))
    truths = pair_rows(base, new, [*KEY, "stamp_ns"])[["truth", "truth_base"]]
    return int((truths.ne(0).all(axis=1) & truths["truth"].ne(truths["truth_base"])).sum())


def common_regions(pairs: pd.DataFrame, new: pd.DataFrame, base: pd.DataFrame) -> pd.DataFrame:
    """Return pairs of masks by region, with their counts, for the regions that both results have.

    ``pairs`` are final masks, as of `common_masks`; ``base`` and ``new`` are rows of ``regions``. A
    region that has other pixels in each result, such as the shadow that another filter found, is
    left out: its ERR would describe other places. Pixels count as the same if each frame of a drive
    has equal numbers of them, and of road among them. Frames that label none are left out, too.
    """
    numbered = pairs[[*KEY, "variant", "stage", "stage_base", "frame", "frame_base"]]
    numbered = numbered.assign(pair=np.arange(len(pairs)))
    by = [*KEY, "variant"]
    on = ["pair", "region"]
    regions = tables.word_type(base["region"], new["region"])
    sides = []
    for table, end in ((base, "_base"), (new, "")):
        names = {"stage": f"stage{end}", "frame": f"frame{end}"}
        rows = table[[*by, *names, "region", *COUNTS]].rename(columns=names)
        words = {n: tables.word_type(numbered[n], rows[n]) for n in (*by, f"stage{end}")}
        rows = numbered.astype(words).merge(rows.astype({**words, "region": regions}))
        sides.append(rows[[*on, *COUNTS]])
    del rows  # released like the sides: they take most of the memory of a long drive
    both = sides.pop(0).merge(
        sides.pop(), on=on, how="outer", suffixes=("_base", ""), indicator="in"
    )
    counts = [*COUNTS, *(f"{name}_base" for name in COUNTS)]
    both[counts] = both[counts].fillna(0).astype(np.int64)
    for name in by:
        both[name] = pairs[name].astype("category").array[both["pair"].to_numpy()]
    road, road_base = both["TP"] + both["FN"], both["TP_base"] + both["FN_base"]
    other, other_base = both["TN"] + both["FP"], both["TN_base"] + both["FP_base"]
    same, labelled = (road == road_base) & (other == other_base), road + other > 0
    both = both.assign(same=same, labelled=labelled, in_new=both["in"] != "left_only")
    parts = group_rows(both, [*by, "region"])
    in_both = parts[["labelled", "in_new"]].transform("any").all(axis=1)
    shared = parts["same"].transform("all") & in_both
    both = both[shared & both["labelled"]]  # by pair, as the merge sorts them
    stamps = pairs["stamp_ns"].to_numpy()[both["pair"]]
    both = both.assign(stamp_ns=stamps, final=True)
    tested = {TESTED: METRICS[TESTED]}
    return both.join([rates_of(both, tested), rates_of(both, tested, end="_base")])


@dataclass(frozen=True)
class MovedFrame:
    """A frame with a great change of the final ERR from the base to the new result."""

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
    """Shares of its labelled pixels that only the base's mask, or only the new one, has right."""


def moved_frames(result: str, pairs: pd.DataFrame) -> Iterator[MovedFrame]:
    """Yield the frames on which the ERR of the first final mask changed most."""
    pairs = next((rows for _, rows in group_rows(only(pairs, final=True), MASK)), pairs)
    base = pairs[f"{TESTED}_base"]
    pairs = pairs.assign(before=base, change=pairs[TESTED] - base)
    for harmed in (True, False):
        for row in tables.most_changed_frames(pairs, NAMED, harmed=harmed).to_dict("records"):
            was, change = row["before"], row["change"]
            about = row["variant"], row["frame"], row["stamp_ns"]
            yield MovedFrame(result, *about, was, was + change, change)


def disagreements(
    table: pd.DataFrame, pairs: pd.DataFrame, base: str, new: str
) -> Iterator[Disagreement]:
    """Yield frames on which two variants of a run disagree most, one of several neighbours.

    ``table`` has the rows of ``disagreements``; only the frames of ``pairs`` are considered.
    """
    sides = ((base, new, "repaired", "spoiled"), (new, base, "spoiled", "repaired"))
    stamps = pairs[["frame", "stamp_ns"]].drop_duplicates()
    for one, other, new_right, base_right in sides:
        rows = only(table, from_variant=one, to_variant=other)
        rows = rows[rows["N"] > 0].merge(stamps, on="frame")
        mine, theirs = rows[new_right] / rows["N"], rows[base_right] / rows["N"]
        rows = rows.assign(mine=mine, theirs=theirs, change=mine + theirs)
        for row in tables.most_changed_frames(rows, NAMED, harmed=True).to_dict("records"):
            right = row["theirs"], row["mine"]
            yield Disagreement(new, new, row["frame"], row["stamp_ns"], *right)
