"""Tables of a report that are made of tables: paired differences, regions, perfect stages.

Everything is computed from ``frames.csv`` and ``regions.csv`` alone, so that a recording of a run
that was killed is understood as well as a complete one.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from roadeval.data import OUTCOMES, Counts
from roadeval.evaluation import effects, metrics
from roadeval.evaluation.regions import partitions

if TYPE_CHECKING:
    import pandas as pd


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


def finals(frames: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of each variant's final mask, as `scored.finals` does for rows of arrays."""
    masks = frames[["variant", "stage"]].drop_duplicates()
    last = effects.final_stages(masks.itertuples(index=False))
    return frames[frames["stage"] == frames["variant"].map(last)]


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
