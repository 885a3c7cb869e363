"""Analysis of the tables: totals, windows, paired differences, regions, causes, worst frames.

Everything is computed from ``frames.csv`` and ``regions.csv`` alone, so that a recording of a run
that was killed is understood as well as a complete one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import FILTERED, UNFILTERED, Counts
from roadeval.evaluation import differences, metrics
from roadeval.evaluation.frame_counts import FrameCounts, sum_up
from roadeval.evaluation.regions import partitions
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.windows import Window, cut

if TYPE_CHECKING:
    import pandas as pd

OUTCOMES: Final = ("TP", "TN", "FP", "FN")
FILTER: Final = "filter"
"""The part of an error rate that the filter caused, beside the stages'."""


def settings_of(summary: Mapping[str, Any]) -> EvaluationSettings:
    """Return the settings that a summary was made with; the defaults where it states none.

    A setting that this version does not know is left out.
    """
    given = summary.get("run", {}).get("evaluation", {})
    known = {field.name for field in fields(EvaluationSettings)}
    return EvaluationSettings(**{name: given[name] for name in known & given.keys()})


def final_stages(frames: pd.DataFrame) -> dict[str, str]:
    """Return each variant's final stage: ``post``, or the last that it has."""
    masks = frames[["variant", "stage"]].drop_duplicates()
    return differences.final_stages(masks.itertuples(index=False))


def finals(frames: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of each variant's final mask, of a table with ``variant`` and ``stage``."""
    return frames[frames["stage"] == frames["variant"].map(final_stages(frames))]


def totals(frames: pd.DataFrame) -> dict[str, dict[str, dict[str, Any]]]:
    """Sum up by variant and stage, as in ``summary.json``."""
    sums: dict[str, dict[str, dict[str, Any]]] = {}
    for (variant, stage), rows in frames.groupby(["variant", "stage"], sort=False):
        sums.setdefault(str(variant), {})[str(stage)] = sum_up_rows(rows)
    return sums


def sum_up_rows(rows: pd.DataFrame) -> dict[str, Any]:
    """Sum up the rows of one mask, see `roadeval.evaluation.frame_counts.sum_up`."""
    return sum_up(rows[[*OUTCOMES]].to_numpy(np.int64))


def overlap(total: dict[str, Any]) -> dict[str, float]:
    """Compute IoU, F1 and precision of a total's pooled counts."""
    return metrics.overlap(Counts(*(total[name] for name in OUTCOMES)))


def masks(frames: pd.DataFrame) -> Iterator[FrameCounts]:
    """Yield the counts of each variant's stages, in the table's order."""
    places = {number: place for place, number in enumerate(frames["frame"].unique().tolist())}
    for (variant, stage), rows in frames.groupby(["variant", "stage"], sort=False):
        positions = rows["frame"].map(places).to_numpy(np.int64)
        counts = rows[[*OUTCOMES]].to_numpy(np.int64)
        yield FrameCounts(str(variant), str(stage), positions, counts)


def windows(frames: pd.DataFrame, size: int) -> Iterator[Window]:
    """Cut the drive into windows of ``size`` evaluated frames, one mask after the other."""
    numbers = frames["frame"].unique().tolist()
    for mask in masks(frames):
        yield from cut(mask, numbers, size)


# --- One variant against another ------------------------------------------------------------------


def pairs(frames: pd.DataFrame, treated: str, control: str) -> pd.DataFrame:
    """Subtract the final masks' rates frame by frame, ``treated`` minus ``control``.

    Returns
    -------
    DataFrame
        Indexed by ``frame``, in the drive's order; ``stamp_ns``, a column a rate, and the net
        change of wrong pixels as ``wrong``.
    """
    last = finals(frames)
    columns = ["stamp_ns", *OUTCOMES, *metrics.METRICS]
    mine, theirs = (
        last[last["variant"] == name].set_index("frame")[columns] for name in (treated, control)
    )
    mine, theirs = mine.align(theirs, join="inner", axis=0)
    found = mine[[*metrics.METRICS]] - theirs[[*metrics.METRICS]]
    found["wrong"] = mine[["FP", "FN"]].sum(axis=1) - theirs[["FP", "FN"]].sum(axis=1)
    found.insert(0, "stamp_ns", mine["stamp_ns"])
    return found


# --- Where the errors are -------------------------------------------------------------------------


def by_region(regions: pd.DataFrame) -> pd.DataFrame:
    """Pool the final masks' counts by variant and region.

    Returns
    -------
    DataFrame
        ``variant``, ``region``, the counts, the rates of short tables, and ``pixels`` and
        ``errors``: the region's share of all labelled pixels, and of all wrong ones.
    """
    sums = finals(regions).groupby(["variant", "region"], sort=False)[[*OUTCOMES]].sum()
    counts = [Counts(*row) for row in sums.to_numpy().tolist()]
    for name, metric in metrics.SHORT.items():
        sums[name] = [metric.function(each) for each in counts]
    table = sums.reset_index()
    wrong, labelled = table["FP"] + table["FN"], table[[*OUTCOMES]].sum(axis=1)
    halves = table["region"].isin(next(iter(partitions(table["region"].unique().tolist())), []))
    for column, share in (("pixels", labelled), ("errors", wrong)):
        whole = share[halves].groupby(table["variant"]).sum()
        table[column] = share / table["variant"].map(whole)
    return table


# --- If a stage were perfect ----------------------------------------------------------------------


def oracles(table: pd.DataFrame, frames: pd.DataFrame) -> pd.DataFrame:
    """Average the final masks' rates once a stage was replaced by the truth.

    Returns
    -------
    DataFrame
        ``variant``, ``oracle``, the rates of short tables, the ``frames`` they are known on, and
        ``as_is``: the ERR on the same frames as it really is. Empty if nothing was counted.
    """
    import pandas as pd

    if not len(table):
        return pd.DataFrame()
    last = table.groupby(["variant", "oracle"], sort=False)["stage"].transform("last")
    own = finals(frames)[["frame", "variant", "ERR"]].rename(columns={"ERR": "as_is"})
    both = table[table["stage"] == last].merge(own, on=["frame", "variant"])
    grouped = both.groupby(["variant", "oracle"], sort=False)
    sums = grouped[[*metrics.SHORT, "as_is"]].mean()
    sums["frames"] = grouped.size()
    return sums.reset_index()


# --- Which stage broke it -------------------------------------------------------------------------


def causes(frames: pd.DataFrame, variant: str) -> pd.DataFrame:
    """Take each frame's error rate apart, stage by stage.

    The final mask's ERR is a sum: the ERR of the mask that the final stage was given, as it is
    without the filter; what the filter changed in that mask (`FILTER`, where both default
    variants ran); and what the final stage changed. The parts add up to ERR exactly.

    Returns
    -------
    DataFrame
        Indexed by ``frame``: a column a part, in that order. A variant of one stage has one.
    """
    import pandas as pd

    mine = _errors(frames, variant)
    if len(mine.columns) == 1:
        return mine
    *_, before, last = mine.columns
    parts = {before: mine[before]}
    unfiltered = _errors(frames, UNFILTERED)
    if variant == FILTERED and before in unfiltered:
        without = unfiltered[before].reindex(mine.index)
        parts = {before: without, FILTER: mine[before] - without}
    return pd.DataFrame({**parts, last: mine[last] - mine[before]})


def _errors(frames: pd.DataFrame, variant: str) -> pd.DataFrame:
    """Return a variant's ERR: a row a frame, a column a stage, in the order the stages ran."""
    rows = frames[frames["variant"] == variant]
    stages = rows["stage"].unique()
    # Where ERR is undefined on every frame there are rows and columns all the same.
    spread = rows.pivot_table(index="frame", columns="stage", values="ERR", dropna=False)
    return spread[[*stages]]


def worst(
    frames: pd.DataFrame, variant: str, count: int, apart_ns: int | None = None
) -> pd.DataFrame:
    """Pick the frames with the highest final ERR of a variant, the worst first.

    Neighbours fail alike, so of frames less than ``apart_ns`` apart only the worst is picked: by
    default a thirtieth of the drive, and at most a second.

    Returns
    -------
    DataFrame
        At most ``count`` rows of the table of frames.
    """
    own = finals(frames[frames["variant"] == variant]).dropna(subset=["ERR"])
    ranked = own.sort_values("ERR", ascending=False, kind="stable")
    return _apart(ranked, count, _neighbourhood(own) if apart_ns is None else apart_ns)


def most_changed(
    paired: pd.DataFrame, count: int, *, harmed: bool, apart_ns: int | None = None
) -> pd.DataFrame:
    """Pick the frames whose ERR rose most (``harmed``) or fell most, of what `pairs` returned.

    Only frames that did rise, or fall, and of neighbours only one, as in `worst`.
    """
    sign = 1 if harmed else -1
    moved = paired[sign * paired["ERR"] > 0].reset_index()
    ranked = moved.sort_values("ERR", ascending=not harmed, kind="stable")
    return _apart(ranked, count, _neighbourhood(paired) if apart_ns is None else apart_ns)


def _neighbourhood(frames: pd.DataFrame) -> int:
    """Return how far apart the stamps of two frames that are no neighbours lie, in nanoseconds."""
    if not len(frames):
        return 0
    return int(min((frames["stamp_ns"].max() - frames["stamp_ns"].min()) // 30, 1_000_000_000))


def _apart(ranked: pd.DataFrame, count: int, apart_ns: int) -> pd.DataFrame:
    taken: list[int] = []
    places = []
    for place, stamp in enumerate(ranked["stamp_ns"].tolist()):
        if len(taken) == count:
            break
        if all(abs(stamp - other) >= apart_ns for other in taken):
            taken.append(stamp)
            places.append(place)
    return ranked.iloc[places]
