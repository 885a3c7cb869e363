"""What the tables say, read again: totals, rows, pairs, regions, and which stage broke a frame.

Everything is computed from ``frames.csv`` and ``regions.csv`` alone, so that a recording of a run
that was killed is understood as well as a complete one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import FILTERED, FINAL_STAGE, UNFILTERED, Counts
from roadeval.evaluation import metrics, windows
from roadeval.evaluation.history import History
from roadeval.evaluation.regions import partitions
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import Difference, mean_difference
from roadeval.evaluation.windows import Window

if TYPE_CHECKING:
    import pandas as pd

OUTCOMES: Final = ("TP", "TN", "FP", "FN")
FILTER: Final = "filter"
"""Stands among the stages for what the shadow filter changed in the mask of a stage after it."""


def settings_of(summary: dict[str, Any]) -> EvaluationSettings:
    """Give the settings that a summary was made with; the defaults where it says nothing."""
    known = {field.name for field in fields(EvaluationSettings)}
    for settings in summary.get("settings", {}).values():
        given = settings.get("evaluation", {})
        return EvaluationSettings(**{name: given[name] for name in known & given.keys()})
    return EvaluationSettings()


def final_stages(frames: pd.DataFrame) -> dict[str, str]:
    """Name each variant's final stage: ``post``, or the last that it has."""
    stages = frames.groupby("variant", sort=False)["stage"].unique()
    return {
        str(variant): FINAL_STAGE if FINAL_STAGE in own else str(own[-1])
        for variant, own in stages.items()
    }


def finals(frames: pd.DataFrame) -> pd.DataFrame:
    """Keep the rows of each variant's final mask, of a table with ``variant`` and ``stage``."""
    return frames[frames["stage"] == frames["variant"].map(final_stages(frames))]


def histories(frames: pd.DataFrame) -> Iterator[History]:
    """Yield what a `Scoreboard` has kept of each variant and stage, in the table's order."""
    places = {number: place for place, number in enumerate(frames["frame"].unique())}
    for (variant, stage), rows in frames.groupby(["variant", "stage"], sort=False):
        yield History.of_table(
            str(variant),
            str(stage),
            rows["frame"].map(places).to_numpy(np.int64),
            rows[[*OUTCOMES]].to_numpy(np.int64),
        )


def totals(frames: pd.DataFrame) -> dict[str, dict[str, dict[str, Any]]]:
    """Sum up by variant and stage, as in ``summary.json``."""
    sums: dict[str, dict[str, dict[str, Any]]] = {}
    for history in histories(frames):
        sums.setdefault(history.variant, {})[history.stage] = history.totals()
    return sums


def overlap(total: dict[str, Any]) -> dict[str, float]:
    """Compute IoU, F1 and precision of a total's pooled counts."""
    return metrics.overlap(Counts(*(total[name] for name in OUTCOMES)))


def rows(frames: pd.DataFrame, size: int) -> pd.DataFrame:
    """Cut the drive into rows of ``size`` evaluated frames, with the columns of ``windows.csv``."""
    import pandas as pd

    numbers = frames["frame"].unique().tolist()
    cut = [row for history in histories(frames) for row in windows.rows(history, numbers, size)]
    return pd.DataFrame([_row(window) for window in cut])


def _row(window: Window) -> dict[str, Any]:
    return {
        "window": window.number,
        "first_frame": window.first_frame,
        "last_frame": window.last_frame,
        "frames": window.frames,
        "variant": window.variant,
        "stage": window.stage,
        **window.rates,
        **{f"pooled_{name}": value for name, value in window.pooled.items()},
    }


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


def differences(
    paired: pd.DataFrame, settings: EvaluationSettings, names: Sequence[str]
) -> dict[str, Difference]:
    """Average paired differences of some rates, with what is known of their uncertainty."""
    return {name: mean_difference(paired[name].to_numpy(float), settings) for name in names}


# --- Where the errors are -------------------------------------------------------------------------


def by_region(regions: pd.DataFrame) -> pd.DataFrame:
    """Pool the final masks' counts by variant and region.

    Returns
    -------
    DataFrame
        ``variant``, ``region``, the counts, ``ERR``, ``FPR``, ``FNR``, and ``pixels`` and
        ``errors``: the region's share of all labelled pixels, and of all wrong ones.
    """
    sums = finals(regions).groupby(["variant", "region"], sort=False)[[*OUTCOMES]].sum()
    counts = [Counts(*row) for row in sums.to_numpy().tolist()]
    for name in ("ERR", "FPR", "FNR"):
        sums[name] = [metrics.METRICS[name].function(each) for each in counts]
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
        ``variant``, ``oracle``, ``ERR``, ``FPR``, ``FNR``, the ``frames`` it is known on, and
        ``as_is``: the ERR on the same frames as it really is. Empty if nothing was counted.
    """
    import pandas as pd

    if not len(table):
        return pd.DataFrame()
    last = table.groupby(["variant", "oracle"], sort=False)["stage"].transform("last")
    own = finals(frames)[["frame", "variant", "ERR"]].rename(columns={"ERR": "as_is"})
    both = table[table["stage"] == last].merge(own, on=["frame", "variant"])
    grouped = both.groupby(["variant", "oracle"], sort=False)
    sums = grouped[["ERR", "FPR", "FNR", "as_is"]].mean()
    sums["frames"] = grouped.size()
    return sums.reset_index()


# --- Which stage broke it -------------------------------------------------------------------------


def causes(frames: pd.DataFrame, variant: str) -> pd.DataFrame:
    """Say for each frame how its error rate came about, stage by stage.

    The final mask's ERR is a sum: the ERR of the mask that the final stage was given, as it is
    without the filter; what the filter changed in that mask (`FILTER`, where both default
    variants ran); and what the final stage changed. The parts add up to ERR exactly.

    Returns
    -------
    DataFrame
        Indexed by ``frame``: a column a part, in that order. A variant of one stage has one.
    """
    import pandas as pd

    names = frames["variant"].unique()
    own = {name: _errors(frames[frames["variant"] == name]) for name in names}
    mine = own[variant]
    last, given = mine.columns[-1], list(mine.columns[-2:-1])
    if not given:
        return mine
    (before,) = given
    parts = {before: mine[before]}
    if variant == FILTERED and before in own.get(UNFILTERED, mine[[last]]):
        without = own[UNFILTERED][before].reindex(mine.index)
        parts = {before: without, FILTER: mine[before] - without}
    parts[last] = mine[last] - mine[before]
    return pd.DataFrame(parts)


def _errors(rows: pd.DataFrame) -> pd.DataFrame:
    """Spread a variant's ERR: a row a frame, a column a stage, in the order the stages ran."""
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
    """Pick the frames whose ERR rose most (``harmed``) or fell most, of what `pairs` gave.

    Only frames that did rise, or fall, and of neighbours only one, as in `worst`.
    """
    sign = 1 if harmed else -1
    moved = paired[sign * paired["ERR"] > 0].reset_index()
    ranked = moved.sort_values("ERR", ascending=not harmed, kind="stable")
    return _apart(ranked, count, _neighbourhood(paired) if apart_ns is None else apart_ns)


def _neighbourhood(frames: pd.DataFrame) -> int:
    """Say how far apart two frames' stamps lie, in nanoseconds, if they are no neighbours."""
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
