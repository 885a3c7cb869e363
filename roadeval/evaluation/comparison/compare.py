"""Comparison of results: what changed on the same frames of the same drives, with intervals.

Drives are matched by their names, else by their logs, and their frames by their stamps; a frame
that either result trained on, or that either lacks, is left out of both. Results without a drive in
common are not compared: a difference between them would mix the scene with the method.

Where one drive is compared, intervals are those of its frames; where several are, those of drives.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE, UNFILTERED
from roadeval.data.words import setting
from roadeval.errors import RoadevalError
from roadeval.evaluation import metrics
from roadeval.evaluation.comparison.pairing import (
    ComparedDrive,
    Disagreement,
    MovedFrame,
    Pair,
    Side,
    common_masks,
    common_regions,
    disagreements,
    left_out,
    match_drives,
    moved_frames,
    truth_differs,
)
from roadeval.evaluation.metrics import COMPARED, METRICS, TESTED
from roadeval.evaluation.regions import titles
from roadeval.evaluation.score.scoreboard import within
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.difference import Difference, benjamini_hochberg, holm, over_drives
from roadeval.evaluation.tables import (
    COUNTS,
    KEY,
    MASK,
    grouped,
    is_final,
    only,
    rates_of,
    values_of,
)
from roadeval.runtime.sentence import Sentence, Setting

if TYPE_CHECKING:
    import pandas as pd

FALSE: Final = 0.05
"""The share of the drives called changed that may be false, on average."""
_OF_THE_LOG: Final = ("topics.", "labels.", "frames.every", "frames.scale")
"""Settings that change the frames and their truth, and not the method."""


class ComparisonError(RoadevalError):
    """Results that cannot be compared."""


@dataclass(frozen=True)
class ComparedResult:
    """One of the results."""

    label: str
    drives: int
    scored: int
    """Drives that it has, and how many of them are scored."""
    drive: str | None
    log_digest: str | None
    """The one drive's name and its log's digest; None for several, or where it is not known."""
    frames: int
    """Evaluated frames of the drives that are compared."""
    scale: float | None
    """``frames.scale``, where it is known and one for all drives."""
    relabelled: int = 0
    """Frames whose truth is another than the base's."""


@dataclass(frozen=True)
class Change:
    """What changed in a mask of a new result: one stage of one variant."""

    result: str
    """Label of the new result."""
    variant: str
    stage: str
    final: bool
    """Whether it is the variant's final mask."""
    drives: int
    frames: int
    """Drives and frames that both have."""
    base: Mapping[str, float]
    new: Mapping[str, float]
    """Metrics: means over drives of the drives' means, each group of drives alike; ``pooled_*`` and
    those of the overlap are of all pixels together. ``base`` is empty where nothing is
    subtracted."""
    difference: Mapping[str, Difference]
    """New minus base by metric; empty where nothing is subtracted."""

    @property
    def name(self) -> str:
        """The result and its variant, which may be called the same."""
        return self.result if self.result == self.variant else f"{self.result}: {self.variant}"

    @property
    def unchanged(self) -> bool:
        """Whether no rate changed, on any frame."""
        return bool(self.difference) and all(each.is_zero for each in self.difference.values())


@dataclass(frozen=True)
class DriveChange:
    """The change in the ERR of a final mask on one of several drives."""

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
    """Whether it is among the drives that are called changed."""


@dataclass(frozen=True)
class RegionChange:
    """The change in the ERR of a final mask within a region.

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


@dataclass(frozen=True)
class Comparison:
    """Results compared with the first of them."""

    results: tuple[ComparedResult, ...]
    """The base first."""
    changed_settings: Mapping[str, Mapping[str, tuple[Any, Any]]]
    """By new result the settings that it does not share with the base: both values by name."""
    changes: tuple[Change, ...]
    """Each mask of each new result, on the frames that it shares with the base."""
    levels: tuple[Change, ...]
    """The same on all of its own frames, without the base."""
    drives: tuple[DriveChange, ...]
    """Where several drives are compared: each, mask by mask, the surest first."""
    regions: tuple[RegionChange, ...]
    """The final masks of each new result, region by region."""
    moved: tuple[MovedFrame, ...]
    """The frames of one drive that changed most."""
    disagreements: tuple[Disagreement, ...]
    """The frames of one drive on which final masks of one run disagree most."""
    warnings: tuple[str, ...]
    """Sentences on drives and frames that were left out, and on settings and truths that differ."""
    settings: EvaluationSettings
    """The confidence of the intervals, and the frames that they need."""

    def finals(self) -> list[Change]:
        """Return the final masks; without the baseline's, which says nothing of a method."""
        finals = [change for change in self.changes if change.final]
        return [change for change in finals if change.variant != BASELINE] or finals


def variants_as_sides(
    whole: Side, there: Sequence[str], chosen: Sequence[str] | None = None
) -> list[Side]:
    """Return the variants of one result as results of their own, the base first.

    ``there`` are all its variants, ``chosen`` those to compare, in order: all but the baseline by
    default, ``unfiltered`` first; of a single one, that against the baseline. A `ComparisonError`
    if a variant is not there, or fewer than two are.
    """
    pipelines = sorted((n for n in there if n != BASELINE), key=lambda name: name != UNFILTERED)
    if len(pipelines) == 1:
        pipelines = [BASELINE] * (BASELINE in there) + pipelines
    names = list(chosen or pipelines)
    for name in names:
        if name not in there:
            raise ComparisonError(f"{whole.label}: no variant {name}; there are {', '.join(there)}")
    if len(names) < 2:
        only = f"{names[0]} alone" if names else "no variant"
        raise ComparisonError(
            f"{whole.label}: {only} cannot be compared; name two of its variants with --variant "
            f"({', '.join(there) or 'it has none'}), or a second result"
        )
    return [replace(whole, label=name, variants={name: name}) for name in names]


def compare(
    sides: Sequence[Side], settings: EvaluationSettings, *, across_variants: bool = False
) -> Comparison:
    """Compare results with the first of them.

    ``across_variants`` says that each side is one variant of the same result, to be matched with
    another one. A `ComparisonError` if a result has nothing to compare, or two have no drive or no
    frame in common.
    """
    for side in sides:
        if not side.scored:
            raise ComparisonError(f"{side.label}: nothing was scored, so nothing can be compared")
    base, *others = sides
    parts = []
    for new in others:
        old, match = base, match_drives(base, new)
        if across_variants:
            old = replace(base, variants={base.label: new.label})
            match = [(drive, drive) for drive in base.scored], []
        parts.append(_against(old, new, match, settings, across=across_variants))
    kinds = ("levels", "drives", "moved", "disagreements", "warnings")
    together = {kind: tuple(chain(*(getattr(part, kind) for part in parts))) for kind in kinds}
    regions = [row for part in parts for row in part.regions]
    corrected = holm([row.difference for row in regions])
    return Comparison(
        results=(_result(base, parts[0].results[0].frames), *(part.results[1] for part in parts)),
        changed_settings={k: v for part in parts for k, v in part.changed_settings.items()},
        changes=tuple(_corrected([row for part in parts for row in part.changes])),
        regions=tuple(replace(r, difference=d) for r, d in zip(regions, corrected, strict=True)),
        settings=settings,
        **together,
    )


def _apart(base: Side, new: Side) -> str:
    """Return why two results have no drive in common."""
    for side in (new, base):
        if any(drive.digest is None for drive in side.scored):
            return f"{side.label} does not say which log it is of, so nothing can be compared"
    return (
        f"{base.label} and {new.label} are of different drives, whose difference would mix the "
        "scene with the method; compare results of the same drives"
    )


def _result(side: Side, frames: int, relabelled: int = 0) -> ComparedResult:
    alone = side.drives[0] if len(side.drives) == 1 else None
    scales = {drive.asked.get("frames.scale") for drive in side.scored}
    return ComparedResult(
        label=side.label,
        drives=len(side.drives),
        scored=len(side.scored),
        drive=alone.name if alone else None,
        log_digest=alone.digest if alone else None,
        frames=frames,
        scale=scales.pop() if len(scales) == 1 else None,
        relabelled=relabelled,
    )


def _corrected(changes: Sequence[Change]) -> Iterator[Change]:
    """Correct the changes of ERR of final masks, but for the baseline's, for how many they are."""
    family = [each.final and each.variant != BASELINE for each in changes]
    tested = [each.difference[TESTED] for each, own in zip(changes, family, strict=True) if own]
    found = iter(holm(tested))
    for each, own in zip(changes, family, strict=True):
        difference = {TESTED: next(found)} if own else {}
        yield replace(each, difference={**each.difference, **difference})


FRAMES: Final = 20_000
"""Evaluated frames of a new result that are in memory together, or those of one drive."""


def _against(
    base: Side,
    new: Side,
    match: tuple[list[Pair], list[str]],
    settings: EvaluationSettings,
    *,
    across: bool,
) -> Comparison:
    """Compare a new result with the base, on the frames that both evaluated."""
    import pandas as pd

    matched, left = match
    if not matched:
        raise ComparisonError(_apart(base, new))
    over = _Over.of(new, matched, settings)
    old_keys = {drive.key: old.key for old, drive in matched}
    sums = Counter[str]()
    levels, masks, regions = [], [], []
    drives: list[DriveChange] = []
    apart: list[str] = []
    pairs = parts = pd.DataFrame()
    for batch in _batches(new.scored):
        frames = new.table("frames", {key: key for key in batch})
        sums["new"] += _frames(frames)
        levels.append(by_drive(frames.assign(final=is_final(frames)), MASK))
        olds = {old_keys[key]: key for key in batch if key in old_keys}
        if not olds:
            continue
        old_frames = base.table("frames", olds)
        sums["base"] += _frames(old_frames)
        common = common_masks(old_frames, frames)
        there = {*zip(common["drive"], common["camera"], strict=True)}
        apart += [over.names[key] for key in olds.values() if key not in there]
        if not there:
            continue
        pairs = common
        sums.update(_differing(*(_of_drives(each, there) for each in (old_frames, frames)), pairs))
        masks.append(by_drive(pairs, MASK))
        tested = only(pairs, final=True)
        tested = tested[tested["variant"] != BASELINE]
        drives += over.within_drives(tested)
        new_regions = new.table("regions", {key: key for key in olds.values()})
        parts = common_regions(tested, new_regions, base.table("regions", olds))
        regions.append(by_drive(parts, ["variant", "region"]))
    if not masks:
        raise ComparisonError(
            f"{base.label} and {new.label} have no evaluated frame and stage in common, so "
            "nothing can be compared; replay the same range into both"
        )
    moved: Iterator[MovedFrame] = iter(())
    disagreed: Iterator[Disagreement] = iter(())
    changed, labels = _changed_settings(matched), (base.label, new.label)
    if len(matched) == 1:  # one camera of one drive, whose frames have numbers of their own
        moved = moved_frames(new.label, pairs)
        if across:
            disagreed = disagreements(new.table("disagreements", [*old_keys]), pairs, *labels)
    return Comparison(
        results=(_result(base, sums["base"]), _result(new, sums["new"], sums["relabelled"])),
        changed_settings={new.label: changed} if changed else {},
        changes=tuple(over.changes(pd.concat(masks), pairs)),
        levels=tuple(over.changes(pd.concat(levels))),
        drives=tuple(over.drives(drives)),
        regions=tuple(over.regions(pd.concat(regions), parts)),
        moved=tuple(moved),
        disagreements=tuple(disagreed),
        warnings=(*left, *_warnings(labels, apart, sums, changed)),
        settings=settings,
    )


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


def _of_drives(rows: pd.DataFrame, keys: Collection[tuple[str, str]]) -> pd.DataFrame:
    return rows[[key in keys for key in zip(rows["drive"], rows["camera"], strict=True)]]


def by_drive(rows: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Sum up each drive's rows of frames, or pairs of them, by the columns ``by``.

    Returned are ``frames``, whether all are ``final``, the summed counts, and the means of the
    frames' rates; of pairs also those of the base, which end in ``_base``, and of the differences,
    as ``change_ERR``.
    """
    import pandas as pd

    counts, rates = [*COUNTS], [rates_of(rows, METRICS)]
    if "TP_base" in rows:
        old = rates_of(rows, METRICS, end="_base")
        change = rates[0] - old.set_axis([*METRICS], axis=1)
        rates += [old, change.add_prefix("change_")]
        counts += [f"{name}_base" for name in COUNTS]
    keys = [*KEY, *by]
    groups, rated = grouped(rows, keys), pd.concat([rows[keys], *rates], axis=1)
    sums = groups[counts].sum().assign(frames=groups.size(), final=groups["final"].all())
    return sums.join(grouped(rated, keys).mean()).reset_index()


@dataclass(frozen=True)
class _Over:
    """How a new result is averaged over its drives, or over the frames of the only one."""

    label: str
    settings: EvaluationSettings
    groups: Mapping[tuple[str, str], str]
    """By drive and camera: the group that counts as one; copies of a log are one."""
    names: Mapping[tuple[str, str], str]
    several: bool
    """Whether several drives are compared, so that intervals are over these."""

    @classmethod
    def of(cls, new: Side, matched: Sequence[Pair], settings: EvaluationSettings) -> _Over:
        firsts = {drive.digest: drive.drive for drive in reversed(new.scored)}
        groups = {drive.key: drive.group or firsts[drive.digest] for drive in new.scored}
        of_base = {drive.key: old.group for old, drive in matched if old.group and not drive.group}
        names = {drive.key: drive.name for drive in new.drives}
        several = len({drive.drive for _, drive in matched}) > 1
        return cls(new.label, settings, groups | of_base, names, several)

    def _group(self, rows: pd.DataFrame) -> list[str]:
        return [self.groups[key] for key in zip(rows["drive"], rows["camera"], strict=True)]

    def mean(self, rows: pd.DataFrame, names: Sequence[str]) -> list[float]:
        """Average drives as their differences are, so that these lie between two rates."""
        means: list[float] = (
            rows.groupby(np.array(self._group(rows)))[[*names]].mean().mean().tolist()
        )
        return means

    def difference(self, rows: pd.DataFrame, rate: str, pairs: pd.DataFrame) -> Difference:
        """Return the difference over drives, or within the one drive whose ``pairs`` are given."""
        if not self.several:
            return within(pairs, rate, self.settings)
        drives = rows.assign(group=self._group(rows), mean=rows[f"change_{rate}"])
        better = METRICS[rate].higher_is_better
        return over_drives(drives, self.settings.confidence, higher_is_better=better)

    def rates(self, rows: pd.DataFrame, end: str = "") -> dict[str, float]:
        """Return the means over drives of a mask's rates, and those of all its pixels together."""
        means = self.mean(rows, [f"{name}{end}" for name in METRICS])
        sums = rows[[f"{name}{end}" for name in COUNTS]].sum().to_frame().T
        overlap = rates_of(sums, metrics.OVERLAP, end=end)
        pooled = overlap.join(rates_of(sums, prefix="pooled_", end=end)).iloc[0]
        rest = {str(name).removesuffix(end): float(value) for name, value in pooled.items()}
        return dict(zip(METRICS, means, strict=True)) | rest

    def changes(self, rows: pd.DataFrame, pairs: pd.DataFrame | None = None) -> Iterator[Change]:
        """Yield a row for each mask; without pairs its rates alone."""
        for (variant, stage), mask in grouped(rows, MASK):
            difference = {}
            if pairs is not None:
                frames = pairs if self.several else only(pairs, variant=variant, stage=stage)
                difference = {rate: self.difference(mask, rate, frames) for rate in COMPARED}
            yield Change(
                result=self.label,
                variant=variant,
                stage=stage,
                final=bool(mask["final"].all()),
                drives=len(mask),
                frames=int(mask["frames"].sum()),
                base=self.rates(mask, "_base") if difference else {},
                new=self.rates(mask),
                difference=difference,
            )

    def regions(self, rows: pd.DataFrame, parts: pd.DataFrame) -> Iterator[RegionChange]:
        """Yield what changed by region."""
        for variant, (region, title) in product(
            values_of(rows, "variant"), titles(values_of(rows, "region")).items()
        ):
            drives = only(rows, variant=variant, region=region)
            if len(drives):
                frames = parts if self.several else only(parts, variant=variant, region=region)
                base, new = self.mean(drives, [f"{TESTED}_base", TESTED])
                change = self.difference(drives, TESTED, frames)
                about = self.label, variant, region, title, int(drives["frames"].sum())
                yield RegionChange(*about, base, new, change)

    def within_drives(self, pairs: pd.DataFrame) -> Iterator[DriveChange]:
        """Yield each of several drives' changes of final masks, not corrected for their number."""
        by_mask = grouped(pairs, [*KEY, *MASK])
        means = by_mask[[f"{TESTED}_base", TESTED]].mean()
        for (drive, camera, variant, stage), rows in by_mask if self.several else ():
            base, new = means.loc[drive, camera, variant, stage].tolist()
            change = within(rows, TESTED, self.settings)
            about = self.label, variant, stage, self.names[drive, camera], len(rows)
            yield DriveChange(*about, base, new, change, q=None, changed=False)

    def drives(self, changes: Sequence[DriveChange]) -> Iterator[DriveChange]:
        """Yield the changes on single drives, mask by mask, the surest first."""
        for mask in dict.fromkeys((change.variant, change.stage) for change in changes):
            rows = [change for change in changes if (change.variant, change.stage) == mask]
            values = benjamini_hochberg([row.difference.p for row in rows])
            corrected = (
                replace(row, q=q, changed=q is not None and q <= FALSE)
                for row, q in zip(rows, values, strict=True)
            )
            yield from sorted(corrected, key=_surest_first)


def _surest_first(change: DriveChange) -> tuple[float, float, str]:
    mean = change.difference.mean
    size = 0.0 if math.isnan(mean) else abs(mean)
    return 2.0 if change.q is None else change.q, -size, change.drive


def _frames(rows: pd.DataFrame, end: str = "") -> int:
    """Return on how many frames there is any mask."""
    return len(rows[[*KEY, f"frame{end}"]].drop_duplicates())


def _differing(base: pd.DataFrame, new: pd.DataFrame, pairs: pd.DataFrame) -> dict[str, int]:
    """Count the frames of which only one result has masks, and those whose truth differs."""
    return {
        "lost by new": _frames(base) - _frames(pairs, "_base"),
        "lost by base": _frames(new) - _frames(pairs),
        "relabelled": truth_differs(base, new),
    }


def _warnings(
    labels: tuple[str, str],
    apart: Sequence[str],
    sums: Mapping[str, int],
    changed: Mapping[str, tuple[Any, Any]],
) -> Iterator[str]:
    """Yield what was left out, and what makes the two less comparable than they look."""
    base, new = labels
    if apart:
        yield left_out(apart, new, f"no evaluated frame in common with {base}")
    for label, other, lost in ((base, new, "lost by new"), (new, base, "lost by base")):
        if frames := sums[lost]:
            yield (
                f"{frames} frames that {label} evaluated are left out against {other}, which "
                "lacks them or trained on them"
            )
    of_the_log = [
        Sentence("{} {} and {}", Setting(name), setting(before), setting(after))
        for name, (before, after) in changed.items()
        if name.startswith(_OF_THE_LOG)
    ]
    if of_the_log:
        yield Sentence(
            "{} and {} were replayed with different settings ({}): part of the change may be "
            "theirs",
            base,
            new,
            Sentence(", ").join(of_the_log),
        )
    if relabelled := sums["relabelled"]:
        guess = "" if of_the_log else " (other labels or topics?)"
        yield (
            f"the truth differs on {relabelled} frames between {base} and {new}{guess}: "
            "part of the change may be the truth's"
        )


def _changed_settings(pairs: Sequence[Pair]) -> dict[str, tuple[Any, Any]]:
    """Return both values of the settings that both know and do not share."""
    found: dict[str, tuple[Any, Any]] = {}
    for base, new in pairs:
        own, other = base.asked, new.asked
        for name in own:
            if name in other and own[name] != other[name]:
                found.setdefault(name, (own[name], other[name]))
    return found
