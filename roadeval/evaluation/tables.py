"""Tables of counted masks, summed up: totals, windows, pairs, worst frames. A table is a DataFrame.

Rows are as in `roadeval.results.schema.TABLES`, for one drive or any number. Columns such as
`KEY` and `MASK` name the groups of the sums, and everything follows from the four counts of a row.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import FILTERED, FINAL_STAGE, OUTCOMES, UNFILTERED
from roadeval.data.arrays import Flags, Sums
from roadeval.evaluation import metrics
from roadeval.evaluation.metric import Metric
from roadeval.evaluation.metrics import METRICS, TESTED
from roadeval.evaluation.regions import HALVES

if TYPE_CHECKING:
    import pandas as pd

KEY: Final = ["drive", "camera"]
MASK: Final = ["variant", "stage"]
COUNTS: Final = [*OUTCOMES]
FILTER: Final = "filter"
"""The part of an error rate that the filter caused, beside the parts of the stages."""


def group_rows(table: pd.DataFrame, by: Sequence[str]) -> Any:
    """Group rows by columns, in the order in which the groups first occur, as pandas does."""
    return table.groupby([*by], sort=False, observed=True)


def concatenate(tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """Concatenate tables; a column is a categorical if it is one in any of them."""
    import pandas as pd

    all_parts = [*tables]
    parts = [part for part in all_parts if len(part)] or all_parts[:1]
    words = {n: None for part in all_parts for n in part.columns[part.dtypes == "category"]}
    for name in words if len(parts) > 1 else ():
        if len({part[name].dtype for part in parts}) == 1:
            continue
        columns = [part[name].astype("category") for part in parts]
        # A column without any word has no categories of text.
        columns = [c.cat.rename_categories([*map(str, c.cat.categories)]) for c in columns]
        texts = [text for column in columns for text in column.drop_duplicates().dropna()]
        for place, column in enumerate(columns):
            codes = column.cat.set_categories([*dict.fromkeys(texts)])
            parts[place] = parts[place].assign(**{name: codes})
    return pd.concat(parts, ignore_index=True)


def only(table: pd.DataFrame, **values: Any) -> pd.DataFrame:
    """Return the rows that have the given values in some columns."""
    chosen = np.ones(len(table), bool)
    for name, value in values.items():
        chosen &= (table[name] == value).to_numpy()
    return table[chosen]


def keys_of(table: pd.DataFrame) -> tuple[list[tuple[str, str]], Sums]:
    """Return the distinct drives and cameras of a table, and each row's place in that list."""
    keys = table[KEY].drop_duplicates().astype("str")
    return [*keys.itertuples(index=False, name=None)], group_rows(table, KEY).ngroup().to_numpy()


def values_of(table: pd.DataFrame, column: str) -> list[Any]:
    """Return the distinct values of a column, in the order in which they first occur."""
    values: list[Any] = table[column].unique().tolist()
    return values


def rates_of(
    table: pd.DataFrame,
    by_name: Mapping[str, Metric] = metrics.ALL,
    prefix: str = "",
    end: str = "",
) -> pd.DataFrame:
    """Compute a column for each metric from each row's counts; NaN if it is undefined.

    With ``end`` the names of the columns of counts and metrics end in it, as ``TP_base`` does.
    """
    import pandas as pd

    counts = table[[f"{name}{end}" for name in COUNTS]].to_numpy(np.int64)
    names = [f"{prefix}{name}{end}" for name in by_name]
    return pd.DataFrame(metrics.table(counts, by_name), table.index, names)


def totals(frames: pd.DataFrame, by: Sequence[str] = MASK) -> pd.DataFrame:
    """Sum up rows of frames: a row for each value of the columns ``by``, which are its index.

    Columns are ``frames``, the summed counts and ``N``; each metric as the mean over the frames on
    which it is defined (the paper's average); ``pooled_<metric>``, computed from the summed counts;
    and ``undefined_<metric>``, the number of frames on which it is undefined.
    """
    import pandas as pd

    sums = group_rows(frames, by)[COUNTS].sum()
    rates = rates_of(frames).groupby([frames[name] for name in by], sort=False, observed=True)
    sizes = rates.size()
    return pd.concat(
        [
            sizes.rename("frames"),
            sums.assign(N=sums.sum(axis=1)),
            rates.mean(),
            rates_of(sums, prefix="pooled_"),
            rates.count().rsub(sizes, axis=0).add_prefix("undefined_"),
        ],
        axis=1,
    )


def as_trees(sums: pd.DataFrame) -> dict[str, dict[str, dict[str, Any]]]:
    """Return `totals` of masks by variant and stage, as ``summary.json`` has them."""
    rates = [*METRICS, *(f"pooled_{name}" for name in METRICS)]
    untabled = [*metrics.UNTABLED, *(f"pooled_{name}" for name in metrics.UNTABLED)]
    trees: dict[str, dict[str, dict[str, Any]]] = {}
    rows: dict[Any, dict[Any, Any]] = sums.to_dict("index")
    for (variant, stage), row in rows.items():
        undefined = {name: int(row[f"undefined_{name}"]) for name in metrics.ALL}
        first = {name: row[name] for name in ("frames", *COUNTS, "N", *rates)}
        last = {name: row[name] for name in untabled}
        trees.setdefault(variant, {})[stage] = {**first, "undefined": undefined, **last}
    return trees


def over_cameras(sums: pd.DataFrame) -> pd.DataFrame:
    """Sum up `totals` by camera over all cameras; a mean is the mean of the cameras' means."""
    by_mask = sums.groupby(MASK, sort=False, observed=True)
    undefined = [f"undefined_{name}" for name in metrics.ALL]
    added = by_mask[["frames", *COUNTS, "N", *undefined]].sum()
    means = by_mask[[*metrics.ALL]].mean()
    return added.join(means).join(rates_of(added, prefix="pooled_"))[[*sums]]


def windows(frames: pd.DataFrame, size: int) -> pd.DataFrame:
    """Return the rows of ``windows.csv``: each camera's frames in windows of ``size``.

    A frame counts if any mask is evaluated on it; the last window may have fewer frames. Rows are
    sorted by window, then by mask.
    """
    rank = group_rows(frames, KEY)["frame"].rank("dense").astype(np.int64)
    cut = frames.assign(window=(rank - 1) // size)
    spans = group_rows(cut, [*KEY, "window"])["frame"].agg(first_frame="min", last_frame="max")
    rows = totals(cut, [*KEY, "window", *MASK]).join(spans).reset_index()
    names = [*KEY, "window", "first_frame", "last_frame", "frames", *MASK, *METRICS]
    names += [f"pooled_{name}" for name in METRICS]
    order = {mask: place for place, mask in enumerate(masks_of(frames))}
    masks = zip(rows["variant"], rows["stage"], strict=True)
    place = np.array([order[mask] for mask in masks], int)
    ranked = np.lexsort((place, rows["window"].to_numpy()))
    return rows.iloc[ranked][names].reset_index(drop=True)


def masks_of(table: pd.DataFrame) -> list[tuple[str, str]]:
    """Return variant and stage of each mask: variants in the table's order, stages as they ran.

    Variants are in the order of their categories, if they are categoricals.
    """
    masks = table[MASK].drop_duplicates()
    if masks["variant"].dtype == "category":
        masks = masks.iloc[np.argsort(masks["variant"].cat.codes, kind="stable")]
    return [*zip(masks["variant"], masks["stage"], strict=True)]


def final_stages(masks: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return each variant's final stage: ``post``, else its last one.

    ``masks`` are in the order in which the stages ran.
    """
    stages: dict[str, str] = {}
    for variant, stage in masks:
        if stages.get(variant) != FINAL_STAGE:
            stages[variant] = stage
    return stages


def is_final(table: pd.DataFrame) -> Flags:
    """Return ``(n,)`` whether each row's mask is the final one of its variant on its drive."""
    by = [name for name in (*KEY, "variant") if name in table]
    mask = group_rows(table, [*by, "stage"]).ngroup().to_numpy()
    _, first = np.unique(mask, return_index=True)
    masks = table.iloc[first]
    is_post = masks["stage"] == FINAL_STAGE
    with_post = is_post.groupby([masks[name] for name in by], observed=True).transform("any")
    final = np.where(with_post, is_post, ~masks.duplicated(by, keep="last"))
    return np.asarray(final[mask] if len(mask) else np.zeros(0), bool)


def finals(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of each variant's final mask."""
    return table[is_final(table)]


def word_type(*columns: pd.Series) -> pd.CategoricalDtype:
    """Return one type for columns of words, which are merged without becoming text."""
    import pandas as pd

    return pd.CategoricalDtype(
        sorted({str(word) for column in columns for word in column.unique()})
    )


def pair_rows(base: pd.DataFrame, new: pd.DataFrame, on: Sequence[str]) -> pd.DataFrame:
    """Return the rows that two tables share by the columns ``on``, in the base's order.

    Rows that are equal in these columns are matched in their order. The base's other columns end in
    ``_base``.
    """
    tables = []
    for table in (base, new):
        words = {name: table[name].astype(str) for name in on if table[name].dtype == "category"}
        tables.append(table.assign(**words))
    if not any(table.duplicated([*on]).any() for table in tables):
        return tables[0].merge(tables[1], on=[*on], suffixes=("_base", ""))
    tables = [table.assign(nth=group_rows(table, on).cumcount()) for table in tables]
    pairs = tables[0].merge(tables[1], on=[*on, "nth"], suffixes=("_base", ""))
    return pairs.drop(columns="nth")


def scene_ns(stamps: pd.Series[int]) -> int:
    """Return the least time between two scenes: a quarter of the drive, at most 3 seconds."""
    return min(int(np.ptp(stamps)) // 4, 3_000_000_000) if len(stamps) else 0


def near_ns(stamps: pd.Series[int] | Sums) -> int:
    """Return the least time between non-neighbours: a 30th of the drive, at most 1 second."""
    return min(int(np.ptp(stamps)) // 30, 1_000_000_000) if len(stamps) else 0


def worst(
    frames: pd.DataFrame, count: int, by: str = TESTED, apart_ns: int | None = None
) -> pd.DataFrame:
    """Return at most ``count`` rows with the highest value of a column, the worst first.

    Neighbours fail alike, so only the worst of frames less than ``apart_ns`` apart is returned; the
    default is `near_ns`. Rows without a value are left out.
    """
    frames = frames[frames[by].notna()]
    ranked = np.argsort(-frames[by].to_numpy(), kind="stable")
    return frames.iloc[separate(frames["stamp_ns"].to_numpy(), ranked, count, apart_ns)]


def most_changed_frames(
    pairs: pd.DataFrame,
    count: int,
    *,
    harmed: bool,
    apart_ns: int | None = None,
    besides: Sequence[int] = (),
) -> pd.DataFrame:
    """Return the rows with the greatest rises (``harmed``) or the greatest falls in ``change``.

    Frames without such a change are left out. So are neighbours, as in `worst`, and neighbours of
    the stamps ``besides``.
    """
    rise = (1 if harmed else -1) * pairs["change"].to_numpy()
    ranked = np.argsort(-rise, kind="stable")
    stamps = pairs["stamp_ns"].to_numpy()
    return pairs.iloc[separate(stamps, ranked[rise[ranked] > 0], count, apart_ns, besides)]


def separate(
    stamps: Sums, ranked: Sums, count: int, apart_ns: int | None = None, besides: Sequence[int] = ()
) -> Sums:
    """Return the first ``count`` ranked places that are not neighbours of an earlier one."""
    if apart_ns is None:
        apart_ns = near_ns(stamps)
    places: list[int] = []
    taken = sorted(besides)
    for place, stamp in zip(ranked.tolist(), stamps[ranked].tolist(), strict=True):
        if len(places) == count:
            break
        later = bisect(taken, stamp)
        if all(abs(near - stamp) >= apart_ns for near in taken[max(later - 1, 0) : later + 1]):
            places.append(place)
            taken.insert(later, stamp)
    return np.array(places, np.int64)


def spread(stamps: Sums, ranked: Sums, count: int, besides: Sequence[int] = ()) -> Sums:
    """Return ``count`` places as `separate` does; if they are too few, with less time between."""
    apart = near_ns(stamps)
    while True:
        places = separate(stamps, ranked, count, apart, besides)
        if len(places) == min(count, len(ranked)) or not apart:
            return places
        apart //= 2


def changes(frames: pd.DataFrame, treated: str, control: str) -> pd.DataFrame:
    """Subtract two variants' final masks frame by frame, ``treated`` minus ``control``.

    The result has the treated variant's rows, ``change`` of `TESTED`, and ``wrong``, the change of
    the number of wrong pixels; columns of the control end in ``_base``.
    """
    last = finals(frames)
    pairs = pair_rows(only(last, variant=control), only(last, variant=treated), [*KEY, "frame"])
    wrong = pairs["FP"] + pairs["FN"] - pairs["FP_base"] - pairs["FN_base"]
    change = pairs[TESTED] - pairs[f"{TESTED}_base"]
    return pairs.assign(change=change, wrong=wrong).sort_values("frame")


def causes(frames: pd.DataFrame, variant: str) -> pd.DataFrame:
    """Split each frame's error rate into parts: a row for each frame, a column for each part.

    The final mask's ERR is the sum of the ERR of the mask before the final stage, without the
    filter; the filter's change of that mask (`FILTER`, if both default variants ran); and the final
    stage's change. The parts add up to ERR exactly. A variant of one stage has one part.
    """
    import pandas as pd

    errors = _errors(only(frames, variant=variant))
    if len(errors.columns) <= 1:
        return errors
    *_, before, last = errors
    parts = {before: errors[before]}
    if variant == FILTERED:
        without = _errors(only(frames, variant=UNFILTERED)).reindex(errors.index)
        if before in without:
            parts = {before: without[before], FILTER: errors[before] - without[before]}
    return pd.DataFrame({**parts, last: errors[last] - errors[before]})


def _errors(rows: pd.DataFrame) -> pd.DataFrame:
    """Return a variant's ERR: a row for each frame, a column for each stage as they ran."""
    errors = rows.assign(stage=rows["stage"].astype(str))
    by_stage = errors.pivot_table(TESTED, "frame", "stage", "first", dropna=False)
    return by_stage[values_of(rows, "stage")].rename_axis(None, axis=1)


def by_region(rows: pd.DataFrame) -> pd.DataFrame:
    """Pool the final masks' counts by region and variant, from rows of frames or of drives.

    Region and variant are the index. Columns are the rates of short tables, and ``pixels`` and
    ``errors``: the region's share of all labelled pixels, and of all wrong ones.
    """
    sums = group_rows(finals(rows), ["region", "variant"])[COUNTS].sum()
    sums = sums.assign(pixels=sums.sum(axis=1), errors=sums["FP"] + sums["FN"])
    regions = sums.index.get_level_values("region")
    halves = sums[regions.isin(HALVES)].groupby("variant", observed=True)[["pixels", "errors"]]
    frame = halves.sum().reindex(sums.index.get_level_values("variant")).set_axis(sums.index)
    return rates_of(sums, metrics.SHORT).join(sums[["pixels", "errors"]] / frame)


def by_class(rows: pd.DataFrame) -> pd.DataFrame:
    """Return each class's share of the errors of one mask, from rows of ``classes``.

    The classes' names for people are the index. Columns are ``truth``; ``pixels`` and ``of_other``,
    the class's share of all counted pixels and of the non-road pixels; ``road``, the share of its
    pixels that is called road; ``false``, its share of the false road; ``missed``, the share of the
    missed road that lies beside it; and ``worst``, frames of the first drive. Shares are means over
    drives. Rows with more of the false road come first.
    """
    texts, pixels = rows["name"].astype(str), rows["pixels"]
    is_road, is_other = rows["truth"] == "road", rows["truth"] == "other"
    names = texts.where(texts != "", "class " + rows["class"].astype(str))
    parts = rows.astype({"drive": str, "truth": str, "worst": str}).assign(name=names, all=pixels)
    parts["pixels"] = pixels.where(is_road | is_other, 0)
    parts["of_other"] = pixels.where(is_other, 0)
    parts["false"] = rows["road"].where(is_other, 0)
    parts["lost"] = (pixels - rows["road"]).where(is_road, 0)
    counts = ["all", "pixels", "of_other", "road", "false", "beside", "lost"]
    sums = parts.groupby(["drive", "name"], sort=False)[counts].sum()
    drives = sums.groupby("drive", sort=False).sum()
    drives["beside"] = drives["lost"]
    shares = sums.div(drives, level="drive").assign(road=sums["road"] / sums["all"])
    by_name = shares.groupby("name", sort=False)
    table = (by_name.sum() / (drives > 0).sum()).assign(road=by_name["road"].mean())
    table = table.join(parts.groupby("name", sort=False)[["truth", "worst"]].first())
    table = table.rename(columns={"beside": "missed"}).drop(columns=["all", "lost"])
    return table.sort_values(["false", "missed"], ascending=False, kind="stable")


def perfect_stages(oracles: pd.DataFrame, frames: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Yield the mean rates of final masks when a stage is replaced by the truth.

    A row has ``variant``, ``oracle``, the rates, the number of ``frames`` that have both masks, and
    ``as_is``: the ERR on the same frames without the replacement.
    """
    last = finals(frames)
    for (variant, oracle), rows in group_rows(oracles, ["variant", "oracle"]):
        final = rows[rows["stage"] == rows["stage"].iloc[-1]]
        pairs = pair_rows(only(last, variant=variant), final, [*KEY, "frame"])
        about = {"variant": variant, "oracle": oracle, "frames": len(pairs)}
        rates = {name: float(pairs[name].mean()) for name in METRICS}
        yield {**about, **rates, "as_is": float(pairs[f"{TESTED}_base"].mean())}


def merge_names(chains: Iterable[Iterable[str]]) -> list[str]:
    """Return the names of several chains in one order that agrees with each chain if possible.

    >>> merge_names([("similarity", "svm", "post"), ("trees", "post")])
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
