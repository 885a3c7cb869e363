"""Comparison of results: what changed on the same frames of the same drives, with intervals.

Drives are matched by their names, else by their logs, and their frames by their stamps; a frame
that either result trained on, or that either lacks, is left out of both. Results without a drive in
common are not compared: a difference between them would mix the scene with the method.

Where one drive is compared, intervals are those of its frames; where several are, those of drives.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final

import numpy as np

from roadeval.data import BASELINE, OUTCOMES, UNFILTERED, Counts, Rows
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
    truth_differs,
)
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.regions import titles
from roadeval.evaluation.score import (
    TESTED,
    FrameCounts,
    Name,
    Total,
    camera_masks,
    final_stages,
    means,
    sum_up,
    within,
)
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import (
    CameraRates,
    Difference,
    DriveMean,
    benjamini_hochberg,
    group_means,
    holm,
    over_drives,
)

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
    found = []
    for new in others:
        own = base
        if across_variants:
            match: Match = [(part, part) for part in base.scored], []
            own = replace(base, variants={base.label: new.label})
        else:
            match = match_drives(base, new)
        if not match[0]:
            raise ComparisonError(_apart(base, new))
        found.append(_Against(own, new, match, settings, across=across_variants))
    frames = [found[0].frames[0], *(each.frames[1] for each in found)]
    relabelled = [0, *(each.relabelled for each in found)]
    regions = [row for each in found for row in each.regions()]
    corrected = holm([row.difference for row in regions])
    return Comparison(
        results=tuple(map(_result, sides, frames, relabelled)),
        changed_settings={each.label: each.changed for each in found if each.changed},
        changes=tuple(_corrected([row for each in found for row in each.changes(each.masks)])),
        levels=tuple(row for each in found for row in each.changes(each.levels)),
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


def _result(side: Side, frames: int, relabelled: int) -> ComparedResult:
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


@dataclass(frozen=True, eq=False)
class _OnDrive:
    """A mask, or a region of it, on one drive."""

    part: Part
    group: str
    final: bool
    new: Total
    base: Total | None = None
    """None where nothing is subtracted, and there are no differences."""
    change: Mapping[str, float] = field(default_factory=dict)
    """The means of the frames' differences, by rate."""
    rates: CameraRates | None = None
    """Of the one drive: the frames' rates, ``(n, m)`` each."""
    within: Difference | None = None
    """Of a final mask on one of several drives: what changed in `TESTED`."""


_Masks = defaultdict[Name, list[_OnDrive]]
"""Drives by variant and stage, or region."""
Match = tuple[list[Pair], list[str]]
"""As of `match_drives`."""


def _drive_means(
    own: Sequence[_OnDrive], means: Iterable[Mapping[str, Any]], rate: str
) -> list[DriveMean]:
    pairs = zip(own, means, strict=True)
    return [DriveMean(each.part.drive, each.group, known[rate]) for each, known in pairs]


def _mean(own: Sequence[_OnDrive], totals: Sequence[Total], rate: str) -> float:
    """Average drives as their differences are, so that these lie between two rates."""
    known = group_means(_drive_means(own, totals, rate))
    return float(known.mean()) if len(known) else np.nan


def _over(own: Sequence[_OnDrive], totals: Sequence[Total]) -> dict[str, float]:
    """Return the means over drives, and the rates of all their pixels together."""
    if not totals:
        return {}
    counts = np.array([sum(each[name] for each in totals) for name in OUTCOMES])
    rates = {name: _mean(own, totals, name) for name in METRICS}
    overlap = metrics.overlap(Counts(*counts.tolist()))
    return rates | overlap | metrics.pooled(counts, metrics.ALL)


class _Against:
    """A new result against the base, on the frames that both evaluated."""

    def __init__(
        self, base: Side, new: Side, match: Match, settings: EvaluationSettings, *, across: bool
    ) -> None:
        pairs, self._left_out = match
        self.label = new.label
        self._base, self._new, self._settings, self._across = base, new, settings, across
        self._several = len({new.drive for _, new in pairs}) > 1
        self._alone = len(pairs) == 1
        """Whether it is one camera of one drive, whose frames have numbers of their own."""
        self.changed = _changed_settings(pairs)
        self.frames, self._lost = [0, 0], [0, 0]
        """Of the base and of the new result: evaluated frames, and those that the other lacks."""
        self.relabelled = 0
        self._apart: list[str] = []
        self.levels, self.masks, self._regions = _Masks(list), _Masks(list), _Masks(list)
        self._known: dict[str, None] = {}  # the regions of all drives
        self.moved: list[MovedFrame] = []
        self.disagreements: list[Disagreement] = []
        firsts = {part.digest: part.drive for part in reversed(new.scored)}
        before = {id(own): other for other, own in pairs}
        for part in new.scored:
            rows, other = new.rows(part, "frames"), before.get(id(part))
            masks = camera_masks(rows)
            # Copies of a log count as one drive.
            group = part.group or (other and other.group) or firsts[part.digest]
            last = final_stages(mask.name for mask in masks)
            for mask in masks:
                final = mask.stage == last[mask.variant]
                self.levels[mask.name].append(_OnDrive(part, group, final, sum_up(mask.counts)))
            self.frames[1] += _frames(masks)
            if other is not None:
                self._add(other, part, group, rows)
        if not self.masks:
            raise ComparisonError(
                f"{base.label} and {new.label} have no evaluated frame and stage in common, so "
                "nothing can be compared; replay the same range into both"
            )

    def _add(self, base: Part, new: Part, group: str, rows: Rows) -> None:
        """Add a drive that both have, and the new result's rows of its frames."""
        old_rows = self._base.rows(base, "frames")
        before, after = camera_masks(old_rows), camera_masks(rows)
        self.frames[0] += _frames(before)
        pairs = common_masks(before, after)
        if not pairs:
            self._apart.append(new.name)
            return
        self._lost[0] += _frames(before) - _frames([pair.base for pair in pairs])
        self._lost[1] += _frames(after) - _frames([pair.new for pair in pairs])
        self.relabelled += truth_differs(old_rows, rows)
        for pair in pairs:
            tested = pair.final and pair.new.variant != BASELINE
            self.masks[pair.new.name].append(self._on_drive(new, group, pair, tested=tested))
            if tested:
                self._add_regions(base, new, group, pair)
        if self._alone:
            first = next((pair for pair in pairs if pair.final), pairs[-1])
            self.moved = [*moved_frames(self.label, first)]
            if self._across:
                table, names = new.rows("disagreements"), (self._base.label, self.label)
                self.disagreements = [*disagreements(table, pairs[0].new, *names)]

    def _on_drive(self, part: Part, group: str, pair: MaskPair, *, tested: bool) -> _OnDrive:
        rates, sums = pair.rates, (sum_up(pair.new.counts), sum_up(pair.base.counts))
        made = _OnDrive(part, group, pair.final, *sums, means(rates.rates - rates.base))
        if not self._several:
            return replace(made, rates=rates)
        return replace(made, within=within([rates], TESTED, self._settings) if tested else None)

    def _add_regions(self, base: Part, new: Part, group: str, pair: MaskPair) -> None:
        """Add what changed by region in a final mask that looks at the image."""
        before = region_counts(self._base.rows(base, "regions"), pair.base)
        after = region_counts(self._new.rows(new, "regions"), pair.new)
        self._known.update(dict.fromkeys(before))
        for region, known in common_regions(before, after):
            own, other = (
                mask._replace(counts=counts[region]).take(np.flatnonzero(known))
                for mask, counts in ((pair.base, before), (pair.new, after))
            )
            made = self._on_drive(new, group, MaskPair(own, other, True), tested=True)
            self._regions[pair.new.variant, region].append(made)

    def _difference(self, own: Sequence[_OnDrive], rate: str) -> Difference:
        """Return the difference within the one drive, or over several."""
        if not self._several:
            return within([each.rates for each in own if each.rates], rate, self._settings)
        drives = _drive_means(own, (each.change for each in own), rate)
        better = METRICS[rate].higher_is_better
        return over_drives(drives, self._settings.confidence, higher_is_better=better)

    def changes(self, masks: _Masks) -> Iterator[Change]:
        """Yield a row for each mask; where the base has none of it, its rates alone."""
        for (variant, stage), own in masks.items():
            base = [each.base for each in own if each.base]
            yield Change(
                result=self.label,
                variant=variant,
                stage=stage,
                final=all(each.final for each in own),
                drives=len(own),
                frames=sum(each.new["frames"] for each in own),
                base=_over(own, base),
                new=_over(own, [each.new for each in own]),
                difference={rate: self._difference(own, rate) for rate in COMPARED if base},
            )

    def regions(self) -> Iterator[RegionChange]:
        """Yield what changed by region."""
        named = titles([*self._known])
        variants = dict.fromkeys(variant for variant, _ in self._regions)
        for variant, (region, title) in product(variants, named.items()):
            if own := self._regions.get((variant, region)):
                yield RegionChange(
                    result=self.label,
                    variant=variant,
                    region=region,
                    title=title,
                    frames=sum(each.new["frames"] for each in own),
                    base=_mean(own, [each.base for each in own if each.base], TESTED),
                    new=_mean(own, [each.new for each in own], TESTED),
                    difference=self._difference(own, TESTED),
                )

    def drives(self) -> Iterator[DriveChange]:
        """Yield each of several drives' changes of final masks, the surest first."""
        for (variant, stage), tested in self.masks.items() if self._several else ():
            own = [(e, e.base, e.within) for e in tested if e.base and e.within]
            values = benjamini_hochberg([within.p for _, _, within in own])
            rows = [
                DriveChange(
                    *(self.label, variant, stage, each.part.name, each.new["frames"]),
                    *(base[TESTED], each.new[TESTED], within, q, q is not None and q <= FALSE),
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
        if self.relabelled:
            guess = "" if of_the_log else " (other labels or topics?)"
            yield (
                f"the truth differs on {self.relabelled} frames between {base} and {new}{guess}: "
                "part of the change may be the truth's"
            )


def _frames(masks: Sequence[FrameCounts]) -> int:
    """Return on how many frames there is any of some masks."""
    return len({frame for mask in masks for frame in mask.frames.tolist()})


def _changed_settings(pairs: Sequence[Pair]) -> dict[str, tuple[Any, Any]]:
    """Return both values of the settings that both know and do not share."""
    found: dict[str, tuple[Any, Any]] = {}
    for base, new in pairs:
        own, other = base.asked, new.asked
        for name in own:
            if name in other and own[name] != other[name]:
                found.setdefault(name, (own[name], other[name]))
    return found
