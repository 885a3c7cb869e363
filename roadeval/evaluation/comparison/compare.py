"""Comparison of results: what changed on the same frames of the same drives, with intervals.

Drives are matched by their names, else by their logs, and their frames by their stamps; a frame
that either result trained on, or that either lacks, is left out of both. Results without a drive in
common are not compared: a difference between them would mix the scene with the method.

Where one drive is compared, intervals are those of its frames; where several are, those of drives.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import BASELINE, UNFILTERED, Counts, Rows
from roadeval.data.words import setting
from roadeval.errors import RoadevalError
from roadeval.evaluation import metrics
from roadeval.evaluation.comparison.pairing import (
    Disagreement,
    MaskPair,
    MovedFrame,
    Pair,
    Part,
    Side,
    common_masks,
    common_regions,
    disagreements,
    left_out,
    match_drives,
    moved_frames,
    region_counts,
)
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.regions import titles
from roadeval.evaluation.score import TESTED, FourCounts, Name, counts_of, means, stages_of
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import (
    CameraRates,
    Difference,
    DriveMean,
    benjamini_hochberg,
    group_means,
    holm,
    over_drives,
    within_drive,
)

FALSE: Final = 0.05
"""The share of the drives called changed that may be false, on average."""
_OF_THE_LOG: Final = ("topics.", "labels.", "frames.every", "frames.scale")
"""Settings that change the frames and their truth, and not the method."""


class ComparisonError(RoadevalError):
    """Results that cannot be compared."""


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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

    @property
    def changed(self) -> bool:
        """Whether it is among the drives that are called changed."""
        return self.q is not None and self.q <= FALSE


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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
    if across_variants:
        matches: list[tuple[list[Pair], list[str]]] = [
            ([(part, part) for part in base.scored], []) for _ in others
        ]
    else:
        matches = [match_drives(base, new) for new in others]
    for new, (pairs, _) in zip(others, matches, strict=True):
        if not pairs:
            raise ComparisonError(_apart(base, new))
    found = [
        _Against(base, new, *match, settings, across=across_variants)
        for new, match in zip(others, matches, strict=True)
    ]
    frames = [found[0].base_frames, *(each.new_frames for each in found)]
    changes = [change for each in found for change in each.changes()]
    regions = [row for each in found for row in each.regions()]
    corrected = holm([row.difference for row in regions])
    return Comparison(
        results=tuple(_result(*each) for each in zip(sides, frames, strict=True)),
        changed_settings={each.label: each.changed for each in found if each.changed},
        changes=tuple(_corrected(changes)),
        levels=tuple(row for each in found for row in _changes(each.label, each.levels)),
        drives=tuple(row for each in found for row in each.drives()),
        regions=tuple(replace(r, difference=d) for r, d in zip(regions, corrected, strict=True)),
        moved=tuple(frame for each in found for frame in each.moved),
        disagreements=tuple(frame for each in found for frame in each.disagreements),
        warnings=tuple(sentence for each in found for sentence in each.warnings()),
        settings=settings,
    )


def _apart(base: Side, new: Side) -> str:
    """Return why two results have no drive in common."""
    for side in (new, base):
        if any(part.digest is None for part in side.scored):
            return f"{side.label} does not say which log it is of, so nothing can be compared"
    return (
        f"{base.label} and {new.label} are of different drives, whose difference would mix the "
        "scene with the method; compare results of the same drives"
    )


def _result(side: Side, frames: int) -> ComparedResult:
    only = side.parts[0] if len(side.parts) == 1 else None
    scales = {part.asked.get("frames.scale") for part in side.scored}
    return ComparedResult(
        label=side.label,
        drives=len(side.parts),
        scored=len(side.scored),
        drive=only.name if only else None,
        log_digest=only.digest if only else None,
        frames=frames,
        scale=scales.pop() if len(scales) == 1 else None,
    )


def _corrected(changes: Sequence[Change]) -> Iterator[Change]:
    """Correct the changes of ERR of final masks, but for the baseline's, for how many they are."""
    family = [each.final and each.variant != BASELINE for each in changes]
    tested = [each.difference[TESTED] for each, own in zip(changes, family, strict=True) if own]
    found = iter(holm(tested))
    for each, own in zip(changes, family, strict=True):
        difference = {TESTED: next(found)} if own else {}
        yield replace(each, difference={**each.difference, **difference})


@dataclass(frozen=True, slots=True, eq=False)
class _Sum:
    """A mask's frames on one drive, summed up."""

    means: Mapping[str, float]
    counts: FourCounts
    """``(4,)``."""

    @classmethod
    def of(cls, counts: FourCounts) -> _Sum:
        return cls(means(metrics.table(counts)), counts.sum(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class _OnDrive:
    """A mask, or a region of it, on one drive."""

    part: Part
    group: str
    frames: int
    new: _Sum
    base: _Sum | None = None
    """None where nothing is subtracted, and there are no differences."""
    means: Mapping[str, float] = field(default_factory=dict)
    """Of the frames' differences, by rate."""
    series: CameraRates | None = None
    """Of the one drive: the frames' rates, ``(n, m)`` each."""
    within: Difference | None = None
    """Of a final mask on one of several drives: what changed in `TESTED`."""
    final: bool = True

    def mean(self, means: Mapping[str, float], rate: str) -> DriveMean:
        """Return one of its means as a drive of its group."""
        return DriveMean(self.part.drive, self.group, means[rate])


def _within(own: Sequence[_OnDrive], rate: str, settings: EvaluationSettings) -> Difference:
    """Return the difference of a rate within a drive, by its cameras."""
    place = [*METRICS].index(rate)
    columns = [
        CameraRates(each.series.stamps, each.series.rates[:, place], each.series.base[:, place])
        for each in own
        if each.series
    ]
    return within_drive(columns, settings, higher_is_better=METRICS[rate].higher_is_better)


_Masks = defaultdict[Name, list[_OnDrive]]
"""Drives by variant and stage, or region."""


def _add_levels(masks: _Masks, part: Part, group: str, rows: Rows) -> int:
    """Add a result's own rates on a drive; return how many frames it has."""
    last = stages_of(rows)
    for variant, stage, places in rows.masks():
        own, final = counts_of(rows.take(places)), stage == last[variant]
        drive = _OnDrive(part, group, len(own), _Sum.of(own), final=final)
        masks[variant, stage].append(drive)
    return len(np.unique(rows["frame"]))


def _mean(own: Sequence[_OnDrive], sums: Sequence[_Sum], rate: str) -> float:
    """Average drives as their differences are, so that these lie between two rates."""
    drives = [each.mean(known.means, rate) for each, known in zip(own, sums, strict=True)]
    known = group_means(drives)
    return float(known.mean()) if len(known) else np.nan


def _rates(own: Sequence[_OnDrive], sums: Sequence[_Sum]) -> dict[str, float]:
    """Return the means over drives, and the rates of all their pixels together."""
    if not sums:
        return {}
    total = Counts(*np.sum([each.counts for each in sums], axis=0).tolist())
    pooled = {f"pooled_{name}": value for name, value in metrics.of(total).items()}
    return {name: _mean(own, sums, name) for name in METRICS} | pooled | metrics.overlap(total)


def _changes(
    label: str,
    masks: _Masks,
    differences: Callable[[list[_OnDrive]], Mapping[str, Difference]] = lambda _: {},
) -> Iterator[Change]:
    """Yield a row a mask."""
    for mask, own in masks.items():
        yield Change(
            result=label,
            variant=mask[0],
            stage=mask[1],
            final=all(each.final for each in own),
            drives=len(own),
            frames=sum(each.frames for each in own),
            base=_rates(own, [each.base for each in own if each.base]),
            new=_rates(own, [each.new for each in own]),
            difference=differences(own),
        )


class _Against:
    """A new result against the base, on the frames that both evaluated."""

    def __init__(
        self,
        base: Side,
        new: Side,
        pairs: Sequence[Pair],
        left_out: Sequence[str],
        settings: EvaluationSettings,
        *,
        across: bool,
    ) -> None:
        self.label: Final = new.label
        self._base, self._new, self._settings, self._across = base, new, settings, across
        self._several: Final = len({new.drive for _, new in pairs}) > 1
        self._alone: Final = len(pairs) == 1
        """Whether it is one camera of one drive, whose frames have numbers of their own."""
        self._left_out: Final = left_out
        self.changed: Final = _changed_settings(pairs)
        self.base_frames = self.new_frames = 0
        self._lost = [0, 0]
        self._relabelled = 0
        self._apart: Final[list[str]] = []
        self.levels: Final = _Masks(list)
        self._masks: Final = _Masks(list)
        self._regions: Final = _Masks(list)
        self._known: Final[dict[str, None]] = {}  # the regions of all drives
        self.moved: list[MovedFrame] = []
        self.disagreements: list[Disagreement] = []
        firsts: dict[str | None, str] = {}
        for part in new.scored:
            firsts.setdefault(part.digest, part.drive)
        before = {id(own): other for other, own in pairs}
        for part in new.scored:
            rows = new.rows(part, "frames")
            other = before.get(id(part))
            # Copies of a log count as one drive.
            group = part.group or (other and other.group) or firsts[part.digest]
            self.new_frames += _add_levels(self.levels, part, group, rows)
            if other is not None:
                self._add(other, part, group, base.rows(other, "frames"), rows)
        if not self._masks:
            raise ComparisonError(
                f"{base.label} and {new.label} have no evaluated frame and stage in common, so "
                "nothing can be compared; replay the same range into both"
            )

    def _add(self, base: Part, new: Part, group: str, before: Rows, after: Rows) -> None:
        """Add a drive that both have."""
        masks = common_masks(before, after, self.label if self._across else None)
        self.base_frames += len(np.unique(before["frame"]))
        if not masks:
            self._apart.append(new.name)
            return
        common = [mask.before["frame"] for mask in masks], [mask.after["frame"] for mask in masks]
        for place, (rows, own) in enumerate(zip((before, after), common, strict=True)):
            self._lost[place] += len(np.unique(rows["frame"])) - len(np.unique(np.concatenate(own)))
        differing = [mask.before["frame"][mask.truth_differs] for mask in masks]
        self._relabelled += len(np.unique(np.concatenate(differing)))
        for mask in masks:
            chosen = mask.final and mask.variant != BASELINE
            stamps = mask.after["stamp_ns"]
            made = self._on_drive(new, group, mask.counts, stamps, tested=chosen)
            self._masks[mask.variant, mask.stage].append(replace(made, final=mask.final))
            if chosen:
                regions = self._base.rows(base, "regions"), self._new.rows(new, "regions")
                self._add_regions(new, group, mask, *regions)
        if self._alone:
            first = next((mask for mask in masks if mask.final), masks[-1])
            self.moved = list(moved_frames(self.label, first))
            if self._across:
                table, names = new.rows("disagreements"), (self._base.label, self.label)
                self.disagreements = list(disagreements(table, masks[0].after, *names))

    def _on_drive(
        self,
        part: Part,
        group: str,
        counts: tuple[FourCounts, ...],
        stamps: npt.NDArray[np.int64],
        *,
        tested: bool,
    ) -> _OnDrive:
        before, after = (metrics.table(each) for each in counts)
        base, new = map(_Sum.of, counts)
        made = _OnDrive(part, group, len(before), new, base, means(after - before))
        whole = replace(made, series=CameraRates(stamps, after, before))
        if not self._several:
            return whole
        return replace(made, within=_within([whole], TESTED, self._settings) if tested else None)

    def _add_regions(self, part: Part, group: str, mask: MaskPair, base: Rows, new: Rows) -> None:
        """Add what changed by region in a final mask that looks at the image."""
        called = self._base.label if self._across else mask.variant
        before = region_counts(base, called, mask.base_stage, mask.before)
        after = region_counts(new, mask.variant, mask.stage, mask.after)
        self._known.update(dict.fromkeys(before))
        for region, known in common_regions(before, after):
            counts, stamps = (own[region][known] for own in (before, after)), mask.after["stamp_ns"]
            made = self._on_drive(part, group, tuple(counts), stamps[known], tested=True)
            self._regions[mask.variant, region].append(made)

    def _difference(self, own: Sequence[_OnDrive], rate: str) -> Difference:
        """Return the difference within the one drive, or over several."""
        if not self._several:
            return _within(own, rate, self._settings)
        drives = [each.mean(each.means, rate) for each in own]
        better = METRICS[rate].higher_is_better
        return over_drives(drives, self._settings.confidence, higher_is_better=better)

    def changes(self) -> Iterator[Change]:
        """Yield a row for each mask that both have."""
        return _changes(
            self.label,
            self._masks,
            lambda own: {rate: self._difference(own, rate) for rate in COMPARED},
        )

    def regions(self) -> Iterator[RegionChange]:
        """Yield what changed by region."""
        named, variants = titles([*self._known]), dict.fromkeys(each for each, _ in self._regions)
        for variant, (region, title) in product(variants, named.items()):
            if not (own := self._regions.get((variant, region))):
                continue
            yield RegionChange(
                result=self.label,
                variant=variant,
                region=region,
                title=title,
                frames=sum(each.frames for each in own),
                base=_mean(own, [each.base for each in own if each.base], TESTED),
                new=_mean(own, [each.new for each in own], TESTED),
                difference=self._difference(own, TESTED),
            )

    def drives(self) -> Iterator[DriveChange]:
        """Yield each of several drives' changes of final masks, the surest first."""
        for (variant, stage), tested in self._masks.items() if self._several else ():
            own = [(e, e.base, e.within) for e in tested if e.base and e.within]
            values = benjamini_hochberg([within.p for _, _, within in own])
            rows = [
                DriveChange(
                    *(self.label, variant, stage, each.part.name, each.frames),
                    *(base.means[TESTED], each.new.means[TESTED], within, q),
                )
                for (each, base, within), q in zip(own, values, strict=True)
            ]
            yield from sorted(
                rows,
                key=lambda row: (
                    *(2.0 if row.q is None else row.q, -abs(np.nan_to_num(row.difference.mean))),
                    row.drive,
                ),
            )

    def warnings(self) -> Iterator[str]:
        """Yield what was left out, and what makes the two less comparable than they look."""
        base, new = self._base.label, self.label
        yield from self._left_out
        if apart := self._apart:
            yield left_out(apart, new, f"no evaluated frame in common with {base}")
        for label, other, frames in zip((base, new), (new, base), self._lost, strict=True):
            if frames:
                yield (
                    f"{frames} frames that {label} evaluated are left out against {other}, which "
                    "lacks them or trained on them"
                )
        of_the_log = [
            f"`{name}` {setting(own)} and {setting(other)}"
            for name, (own, other) in self.changed.items()
            if name.startswith(_OF_THE_LOG)
        ]
        if of_the_log:
            yield (
                f"{base} and {new} were replayed with different settings ({', '.join(of_the_log)}):"
                " part of the change may be theirs"
            )
        if self._relabelled:
            guess = "" if of_the_log else " (other labels or topics?)"
            yield (
                f"the truth differs on {self._relabelled} frames between {base} and {new}{guess}: "
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
