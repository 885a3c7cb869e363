"""Comparison of results: what changed on the same frames of the same drives, with intervals.

Drives are matched by their names, else by their logs, and their frames by their stamps; a frame
that either result trained on or lacks is left out of both. Results without a drive in common are
not compared: a difference between them would mix the scene with the method.

If one drive is compared, intervals are over its frames; if several are, over drives.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from roadeval.data import BASELINE, UNFILTERED
from roadeval.data.words import setting
from roadeval.errors import RoadevalError
from roadeval.evaluation import metrics, tables
from roadeval.evaluation.comparison import pairing
from roadeval.evaluation.comparison.pairing import ComparedDrive, Pair, Side
from roadeval.evaluation.metrics import COMPARED, METRICS, TESTED
from roadeval.evaluation.regions import titles
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.difference import (
    Difference,
    benjamini_hochberg,
    holm,
    over_drives,
    within_drive,
)
from roadeval.evaluation.tables import COUNTS, KEY, MASK, group_rows, only, rates_of, values_of
from roadeval.runtime.sentence import Sentence, Setting
from roadeval.runtime.text import likely

if TYPE_CHECKING:
    import pandas as pd

FALSE_DISCOVERY_RATE: Final = 0.05
"""Greatest mean share of chance among the drives that are marked as changed."""
FRAMES: Final = 5_000
"""Evaluated frames of a new result that are in memory together; one drive may have more."""
_LOG_SETTINGS: Final = ("topics.", "labels.", "frames.every", "frames.scale")
"""Settings that change the frames and their truth, and not the method."""


@dataclass(frozen=True)
class ComparedResult:
    """One of the results."""

    label: str
    drives: int
    scored: int
    """Number of all its drives, and number of its scored drives."""
    drive: str | None
    log_digest: str | None
    """Name and log digest of its only drive; None if there are several, or it is not known."""
    frames: int
    """Number of evaluated frames."""
    scale: float | None
    """``frames.scale`` if it is known and the same for all drives."""
    relabelled: int = 0
    """Number of frames with another truth than in the base."""


@dataclass(frozen=True)
class MaskChange:
    """Change of one mask: one stage of one variant of a new result."""

    result: str
    """Label of the new result."""
    variant: str
    stage: str
    final: bool
    """Whether it is the variant's final mask."""
    drives: int
    frames: int
    """Number of drives, and number of frames, that both results have."""
    base: Mapping[str, float]
    new: Mapping[str, float]
    """Metrics by name. Rates are means of the drives' means, with equal weight for each group of
    drives; ``pooled_*`` and metrics of the overlap are computed from the summed counts. ``base`` is
    empty if there is no base."""
    difference: Mapping[str, Difference]
    """New minus base by metric; empty if there is no base."""

    @property
    def name(self) -> str:
        """The result and its variant, which may have the same name."""
        return self.result if self.result == self.variant else f"{self.result}: {self.variant}"

    @property
    def unchanged(self) -> bool:
        """Whether all rates are the same on all frames."""
        return bool(self.difference) and all(rate.is_zero for rate in self.difference.values())


@dataclass(frozen=True)
class DriveChange:
    """Change of a final mask's ERR on one of several drives."""

    result: str
    variant: str
    stage: str
    drive: str
    frames: int
    base: float
    new: float
    difference: Difference
    q: float | None
    """The p-value after Benjamini and Hochberg's correction over all drives."""
    changed: bool
    """Whether the drive counts as changed: ``q`` is at most `FALSE_DISCOVERY_RATE`."""


@dataclass(frozen=True)
class RegionChange:
    """Change of a final mask's ERR within a region.

    ``base`` and ``new`` are means over the ``frames`` on which both have labelled pixels there.
    """

    result: str
    variant: str
    region: str
    title: str
    frames: int
    base: float
    new: float
    difference: Difference


class ClassChange(NamedTuple):
    """Change of a class's share of the false road of a final mask, over all frames of a result."""

    result: str
    variant: str
    name: str
    base: float
    new: float


@dataclass(frozen=True)
class Comparison:
    """Results compared with the first of them."""

    results: tuple[ComparedResult, ...]
    """The base first."""
    changed_settings: Mapping[str, Mapping[str, tuple[Any, Any]]]
    """Settings that differ from the base's: both values, by label of the new result and by name."""
    changes: tuple[MaskChange, ...]
    """Each mask of each new result, on the frames that it shares with the base."""
    levels: tuple[MaskChange, ...]
    """The same masks on all frames of the new result, without the base."""
    drives: tuple[DriveChange, ...]
    """Each drive if several are compared, mask by mask, the surest first."""
    regions: tuple[RegionChange, ...]
    """The final masks of each new result, region by region."""
    moved: tuple[pairing.MovedFrame, ...]
    """The frames of one drive that changed most."""
    disagreements: tuple[pairing.Disagreement, ...]
    """The frames of one drive on which final masks of one run disagree most."""
    warnings: tuple[str, ...]
    """Sentences on drives and frames that were left out, and on settings and truths that differ."""
    settings: EvaluationSettings
    """The confidence of the intervals, and the frames that they need."""
    classes: tuple[ClassChange, ...] = ()
    """The classes of the truth, if it has any, by their share of the new result's false road."""

    def finals(self) -> list[MaskChange]:
        """Return the changes of final masks, without the baseline if there is another variant."""
        finals = [change for change in self.changes if change.final]
        return [change for change in finals if change.variant != BASELINE] or finals


def variants_as_sides(
    result: Side, variants: Sequence[str], chosen: Sequence[str] | None = None
) -> list[Side]:
    """Return variants of one result as results to compare, the base first.

    ``variants`` are the names of all its variants, ``chosen`` the names to compare, in order. By
    default all but the baseline are compared, ``unfiltered`` first; a single one is compared with
    the baseline. A `RoadevalError` if a variant is missing, or there are fewer than two.
    """
    pipelines = sorted((n for n in variants if n != BASELINE), key=lambda name: name != UNFILTERED)
    if len(pipelines) == 1:
        pipelines = [BASELINE] * (BASELINE in variants) + pipelines
    names = list(chosen or pipelines)
    for name in names:
        if name not in variants:
            choice = f"{likely(name, variants)}there are {', '.join(variants)}"
            raise RoadevalError(f"no variant {name}", where=result.label, remedy=choice)
    if len(names) < 2:
        problem = f"{names[0]} alone cannot be compared" if names else "no variant can be compared"
        there = ", ".join(variants) or "it has none"
        remedy = f"name two of its variants with --variant ({there}), or a second result"
        raise RoadevalError(problem, where=result.label, remedy=remedy)
    return [replace(result, label=name, variants={name: name}) for name in names]


def compare(
    sides: Sequence[Side], settings: EvaluationSettings, *, across_variants: bool = False
) -> Comparison:
    """Compare results with the first of them.

    ``across_variants`` says that the sides are variants of one result, to be compared with each
    other. A `RoadevalError` if a result has nothing to compare, or two have no drive or no
    frame in common.
    """
    for side in sides:
        if not side.scored:
            raise RoadevalError("nothing was scored, so nothing can be compared", where=side.label)
    base, *others = sides
    parts = []
    for new in others:
        old, (matched, warnings) = base, pairing.match_drives(base, new)
        if across_variants:
            old = replace(base, variants={base.label: new.label})
            matched, warnings = [(drive, drive) for drive in base.scored], []
        if not matched:
            for side in (new, old):
                if any(drive.digest is None for drive in side.scored):
                    problem = f"{side.label} does not say which log it is from"
                    raise RoadevalError(f"{problem}, so nothing can be compared")
            raise RoadevalError(
                f"{old.label} and {new.label} are of different drives: a comparison would mix "
                "the scene with the method; compare results of the same drives"
            )
        part = _compare_two(old, new, matched, settings, across_variants=across_variants)
        parts.append(replace(part, warnings=(*warnings, *part.warnings)))
    changes = [*chain(*(part.changes for part in parts))]
    family = [n for n, mask in enumerate(changes) if mask.final and mask.variant != BASELINE]
    corrected = holm([changes[place].difference[TESTED] for place in family])
    for place, change in zip(family, corrected, strict=True):
        difference = {**changes[place].difference, TESTED: change}
        changes[place] = replace(changes[place], difference=difference)
    regions = [*chain(*(part.regions for part in parts))]
    corrected = holm([region.difference for region in regions])
    kinds = ("levels", "drives", "moved", "disagreements", "warnings", "classes")
    return Comparison(
        results=(parts[0].results[0], *(part.results[1] for part in parts)),
        changed_settings={k: v for part in parts for k, v in part.changed_settings.items()},
        changes=tuple(changes),
        regions=tuple(replace(r, difference=d) for r, d in zip(regions, corrected, strict=True)),
        settings=settings,
        **{kind: tuple(chain(*(getattr(part, kind) for part in parts))) for kind in kinds},
    )


def _compare_two(
    base: Side,
    new: Side,
    matched: Sequence[Pair],
    settings: EvaluationSettings,
    *,
    across_variants: bool,
) -> Comparison:
    """Compare a new result with the base, on the frames that both evaluated."""
    import pandas as pd

    labels = base.label, new.label
    several = len({drive.drive for _, drive in matched}) > 1
    groups = _groups(new, matched)
    base_keys = {drive.key: old.key for old, drive in matched}
    drive_names = {drive.key: drive.name for drive in new.drives}
    frames = Counter[str]()
    levels, masks, regions = [], [], []
    drives: list[DriveChange] = []
    without_frames: list[str] = []
    for batch in _batches(new.scored):
        new_rows = new.table("frames", {key: key for key in batch})
        frames["new"] += _count_frames(new_rows)
        levels.append(by_drive(new_rows.assign(final=tables.is_final(new_rows)), MASK, groups))
        new_keys = {base_keys[key]: key for key in batch if key in base_keys}
        if not new_keys:
            continue
        base_rows = base.table("frames", new_keys)
        frames["base"] += _count_frames(base_rows)
        variants = [values_of(rows, "variant") for rows in (base_rows, new_rows)]
        pairs = _pair_frames(base_rows, new_rows, frames)
        del base_rows, new_rows  # regions take most memory
        common = {*tables.keys_of(pairs)[0]}
        without_frames += [drive_names[key] for key in new_keys.values() if key not in common]
        if not common:
            continue
        masks.append(by_drive(pairs, MASK, groups))
        finals = only(pairs, final=True)
        finals = finals[finals["variant"] != BASELINE]
        if several:
            drives += _drive_changes(new.label, drive_names, finals, settings)
        new_regions = new.table("regions", {key: key for key in new_keys.values()})
        parts = pairing.common_regions(finals, new_regions, base.table("regions", new_keys))
        regions.append(by_drive(parts, ["variant", "region"], groups, [TESTED]))
    if not masks:
        raise _no_common_mask(labels, *variants)
    one_camera = len(matched) == 1  # then a number names a frame
    of_masks, of_regions = (None, None) if several else (pairs, parts)
    changed = changed_settings(matched)
    old_classes = base.table("classes", {old: key for key, old in base_keys.items()})
    new_classes = new.table("classes", {key: key for key in base_keys})
    return Comparison(
        results=(
            _compared_result(base, frames["base"]),
            _compared_result(new, frames["new"], frames["relabelled"]),
        ),
        changed_settings={new.label: changed} if changed else {},
        changes=tuple(_mask_changes(new.label, pd.concat(masks), of_masks, settings)),
        levels=tuple(_mask_changes(new.label, pd.concat(levels), None, settings)),
        drives=tuple(_rank_drives(drives)),
        regions=tuple(_region_changes(new.label, pd.concat(regions), of_regions, settings)),
        moved=tuple(pairing.moved_frames(new.label, pairs)) if one_camera else (),
        disagreements=tuple(
            pairing.disagreements(new.table("disagreements", [*base_keys]), pairs, *labels)
        )
        if one_camera and across_variants
        else (),
        warnings=tuple(_warnings(labels, without_frames, frames, changed)),
        settings=settings,
        classes=tuple(_class_changes(new.label, old_classes, new_classes)),
    )


def _no_common_mask(
    labels: tuple[str, str], names: Sequence[str], others: Sequence[str]
) -> RoadevalError:
    """Return the error of two results without a common mask; ``names`` are the base's variants."""
    base, new = labels
    if {*names} & {*others}:
        return RoadevalError(
            f"{base} and {new} have no evaluated frame and stage in common, so nothing can be "
            "compared; replay the same range into both"
        )
    return RoadevalError(
        f"{base} has the variants {', '.join(names)}, and {new} {', '.join(others)}",
        remedy=f"name the variants to compare, as --variant {names[0]}={others[0]}",
    )


def _class_changes(label: str, base: pd.DataFrame, new: pd.DataFrame) -> Iterator[ClassChange]:
    """Yield the classes with at least 1 % of the false road; one side may lack their names."""
    both = tables.concatenate([base.assign(side="base"), new.assign(side="new")])
    names = both["name"].astype(str).replace("", None)
    both["name"] = names.fillna(names.groupby(both["class"]).transform("last")).fillna("")
    for variant in [name for name in values_of(new, "variant") if name != BASELINE]:
        sides = (tables.by_class(only(both, variant=variant, side=s)) for s in ("base", "new"))
        before, after = (shares["false"][shares["truth"] == "other"] for shares in sides)
        shares = after.to_frame("new").join(before.rename("base"), how="outer").fillna(0)
        if before.isna().all() or after.isna().all() or shares["new"].equals(shares["base"]):
            continue
        for name, row in shares.sort_values("new", ascending=False, kind="stable").iterrows():
            if row.max() >= 0.01:
                yield ClassChange(label, variant, str(name), row["base"], row["new"])


def _compared_result(side: Side, frames: int, relabelled: int = 0) -> ComparedResult:
    drive = side.drives[0] if len(side.drives) == 1 else None
    scales = {drive.settings.get("frames.scale") for drive in side.scored}
    return ComparedResult(
        label=side.label,
        drives=len(side.drives),
        scored=len(side.scored),
        drive=drive.name if drive else None,
        log_digest=drive.digest if drive else None,
        frames=frames,
        scale=scales.pop() if len(scales) == 1 else None,
        relabelled=relabelled,
    )


def _groups(new: Side, matched: Sequence[Pair]) -> dict[tuple[str, str], str]:
    """Return the group of each drive and camera of ``new``; copies of a log are one group."""
    firsts = {drive.digest: drive.drive for drive in reversed(new.scored)}
    groups = {drive.key: drive.group or firsts[drive.digest] for drive in new.scored}
    of_base = {drive.key: old.group for old, drive in matched if old.group and not drive.group}
    return groups | of_base


def _batches(drives: Sequence[ComparedDrive]) -> Iterator[list[tuple[str, str]]]:
    """Yield the keys of drives that are compared together: all cameras of each."""
    by_name: dict[str, list[ComparedDrive]] = {}
    for drive in drives:
        by_name.setdefault(drive.drive, []).append(drive)
    batch: list[ComparedDrive] = []
    for cameras in by_name.values():
        if batch and sum(drive.frames for drive in (*batch, *cameras)) > FRAMES:
            yield [drive.key for drive in batch]
            batch = []
        batch += cameras
    yield [drive.key for drive in batch]


def _pair_frames(base: pd.DataFrame, new: pd.DataFrame, frames: Counter[str]) -> pd.DataFrame:
    """Return the masks that two results share, and count the other frames of the same drives."""
    pairs = pairing.common_masks(base, new)
    common, sides = {*tables.keys_of(pairs)[0]}, []
    for rows in (base, new):
        keys, places = tables.keys_of(rows)
        sides.append(rows[np.array([key in common for key in keys], bool)[places]])
    frames["only base"] += _count_frames(sides[0]) - _count_frames(pairs, "_base")
    frames["only new"] += _count_frames(sides[1]) - _count_frames(pairs)
    frames["relabelled"] += pairing.truth_differs(*sides)
    return pairs


def by_drive(
    rows: pd.DataFrame,
    by: Sequence[str],
    groups: Mapping[tuple[str, str], str],
    rates: Collection[str] = tuple(METRICS),
) -> pd.DataFrame:
    """Sum up the rows of each drive, a row a frame or a pair of frames, by the columns ``by``.

    The result has the number of ``frames``, whether all are ``final``, the summed counts, the means
    of the ``rates``, and the ``group``, which ``groups`` has by drive and camera. For pairs it also
    has counts and rates of the base, which end in ``_base``, and means of the differences, such as
    ``change_ERR``.
    """
    import pandas as pd

    chosen = {name: METRICS[name] for name in rates}
    counts, parts = [*COUNTS], [rates_of(rows, chosen)]
    if "TP_base" in rows:
        old = rates_of(rows, chosen, end="_base")
        change = parts[0] - old.set_axis([*chosen], axis=1)
        parts += [old, change.add_prefix("change_")]
        counts += [f"{name}_base" for name in COUNTS]
    keys = [*KEY, *by]
    by_keys, rated = group_rows(rows, keys), pd.concat([rows[keys], *parts], axis=1)
    sums = by_keys[counts].sum().assign(frames=by_keys.size(), final=by_keys["final"].all())
    drives = sums.join(group_rows(rated, keys).mean()).reset_index()
    names = [groups[key] for key in zip(drives["drive"], drives["camera"], strict=True)]
    return drives.assign(group=np.array(names, object))


def _means(drives: pd.DataFrame, names: Sequence[str]) -> list[float]:
    """Return the mean of the groups' means of each column; differences are averaged alike."""
    return drives.groupby("group")[[*names]].mean().mean().tolist()


def _difference(
    drives: pd.DataFrame, rate: str, pairs: pd.DataFrame | None, settings: EvaluationSettings
) -> Difference:
    """Return the difference over drives, or within the only drive if its ``pairs`` are given."""
    if pairs is not None:
        return within_drive(pairs, rate, settings)
    means = drives.assign(mean=drives[f"change_{rate}"])
    return over_drives(means, settings.confidence, rate)


def _rates(drives: pd.DataFrame, end: str = "") -> dict[str, float]:
    """Return the means over drives of a mask's rates, and the metrics of all pixels together."""
    means = _means(drives, [f"{name}{end}" for name in METRICS])
    sums = drives[[f"{name}{end}" for name in COUNTS]].sum().to_frame().T
    untabled = rates_of(sums, metrics.UNTABLED, end=end)
    pooled = untabled.join(rates_of(sums, prefix="pooled_", end=end)).iloc[0]
    rest = {str(name).removesuffix(end): float(value) for name, value in pooled.items()}
    return dict(zip(METRICS, means, strict=True)) | rest


def _mask_changes(
    label: str, drives: pd.DataFrame, pairs: pd.DataFrame | None, settings: EvaluationSettings
) -> Iterator[MaskChange]:
    """Yield the change of each mask, or its rates alone if ``drives`` have no base.

    ``pairs`` are the frames of the only drive; None if several are compared.
    """
    compared = COMPARED if f"{TESTED}_base" in drives else ()
    for (variant, stage), mask in group_rows(drives, MASK):
        frames = None if pairs is None else only(pairs, variant=variant, stage=stage)
        yield MaskChange(
            result=label,
            variant=variant,
            stage=stage,
            final=bool(mask["final"].all()),
            drives=len(mask),
            frames=int(mask["frames"].sum()),
            base=_rates(mask, "_base") if compared else {},
            new=_rates(mask),
            difference={rate: _difference(mask, rate, frames, settings) for rate in compared},
        )


def _region_changes(
    label: str, drives: pd.DataFrame, pairs: pd.DataFrame | None, settings: EvaluationSettings
) -> Iterator[RegionChange]:
    """Yield the change in each region; the arguments are as in `_mask_changes`."""
    for variant in values_of(drives, "variant"):
        for region, title in titles(values_of(drives, "region")).items():
            rows = only(drives, variant=variant, region=region)
            if len(rows):
                frames = None if pairs is None else only(pairs, variant=variant, region=region)
                base, new = _means(rows, [f"{TESTED}_base", TESTED])
                change = _difference(rows, TESTED, frames, settings)
                about = label, variant, region, title, int(rows["frames"].sum())
                yield RegionChange(*about, base, new, change)


def _drive_changes(
    label: str,
    names: Mapping[tuple[str, str], str],
    finals: pd.DataFrame,
    settings: EvaluationSettings,
) -> Iterator[DriveChange]:
    """Yield the changes of final masks drive by drive, not corrected for their number."""
    by_mask = group_rows(finals, [*KEY, *MASK])
    means = by_mask[[f"{TESTED}_base", TESTED]].mean().T.to_dict("list")
    for key, pairs in by_mask:
        drive, camera, variant, stage = key
        change = within_drive(pairs, TESTED, settings)
        about = label, variant, stage, names[drive, camera], len(pairs)
        base, new = means[key]
        yield DriveChange(*about, base, new, change, q=None, changed=False)


def _rank_drives(changes: Sequence[DriveChange]) -> Iterator[DriveChange]:
    """Yield the changes on drives, corrected for their number, the surest of each mask first."""

    def surest_first(change: DriveChange) -> tuple[float, float, str]:
        size = abs(np.nan_to_num(change.difference.mean))
        return 2.0 if change.q is None else change.q, -size, change.drive

    for mask in dict.fromkeys((change.variant, change.stage) for change in changes):
        rows = [change for change in changes if (change.variant, change.stage) == mask]
        values = benjamini_hochberg([row.difference.p for row in rows])
        corrected = (
            replace(row, q=q, changed=q is not None and q <= FALSE_DISCOVERY_RATE)
            for row, q in zip(rows, values, strict=True)
        )
        yield from sorted(corrected, key=surest_first)


def _count_frames(rows: pd.DataFrame, end: str = "") -> int:
    """Return the number of frames that have any mask."""
    return len(rows[[*KEY, f"frame{end}"]].drop_duplicates())


def _warnings(
    labels: tuple[str, str],
    without_frames: Sequence[str],
    frames: Mapping[str, int],
    changed: Mapping[str, tuple[Any, Any]],
) -> Iterator[str]:
    """Yield sentences on frames left out, and on settings and truths that differ."""
    base, new = labels
    if without_frames:
        yield pairing.left_out(without_frames, new, f"no evaluated frame in common with {base}")
    for label, other, lost in ((base, new, "only base"), (new, base, "only new")):
        if count := frames[lost]:
            yield (
                f"{count} frames that {label} evaluated are left out, because {other} lacks "
                "them or trained on them"
            )
    differing = [
        Sentence("{} {} and {}", Setting(name), setting(before), setting(after))
        for name, (before, after) in changed.items()
        if name.startswith(_LOG_SETTINGS)
    ]
    if differing:
        yield Sentence(
            "{} and {} were replayed with different settings ({}), which may cause a part of the "
            "change",
            base,
            new,
            Sentence(", ").join(differing),
        )
    if relabelled := frames["relabelled"]:
        guess = "" if differing else " (other labels or topics?)"
        yield (
            f"the truth differs on {relabelled} frames between {base} and {new}{guess}, which may "
            "cause a part of the change"
        )


def changed_settings(pairs: Sequence[Pair]) -> dict[str, tuple[Any, Any]]:
    """Return the settings that both results have and that differ: both values by name."""
    changed: dict[str, tuple[Any, Any]] = {}
    for base, new in pairs:
        for name in (name for name in base.settings if name in new.settings):
            for part, values in _differences(name, base.settings[name], new.settings[name]):
                changed.setdefault(part, values)
    return changed


def _differences(name: str, value: Any, other: Any) -> Iterator[tuple[str, tuple[Any, Any]]]:
    """Yield name and both values of a setting, or of each key of a table, if they differ."""
    if isinstance(value, Mapping) and isinstance(other, Mapping):
        for key in {**value, **other}:
            yield from _differences(f"{name}.{key}", value.get(key), other.get(key))
    elif value != other:
        yield name, (value, other)
