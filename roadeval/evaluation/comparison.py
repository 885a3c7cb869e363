"""Comparison of results: what changed on the same frames, with intervals.

Results of the same log are matched frame by frame, by their stamps; a frame that either trained
on, or that either lacks, is left out of both. Results of different logs are only put side by side:
a difference between them would mix the scene with the method.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, Final

from roadeval.data import BASELINE, UNFILTERED, Rows
from roadeval.errors import RoadevalError
from roadeval.evaluation import scored, where
from roadeval.evaluation.comparison_result import (
    ComparedResult,
    Comparison,
    Disagreement,
    DrivesDiffer,
    FramesLeftOut,
    LogUnknown,
    MaskComparison,
    MovedFrame,
    Note,
    RegionComparison,
    SettingsDiffer,
    TruthDiffers,
    VariantLeftOut,
)
from roadeval.evaluation.differences import final_stages
from roadeval.evaluation.frame_counts import sum_up
from roadeval.evaluation.matching import common_masks
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import holm, mean_difference

MOVED: Final = 5
"""Frames named of those that changed most, in each direction."""


class ComparisonError(RoadevalError):
    """Results that cannot be compared."""


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One of the results that are compared.

    Parameters
    ----------
    label
        What it is called in tables; its own among all.
    drive, digest
        The log's name and SHA-256, None where the result does not know it.
    frames
        The rows of ``frames.csv``.
    asked
        What was asked of the log, by the settings' names as ``frames.scale``; empty where the
        result does not know it.
    regions, disagreements
        The rows of the tables of these names; None where nobody asks for them.
    own_names
        What the result itself calls its variants, where they are compared under other names.
    """

    label: str
    drive: str
    digest: str | None
    frames: Rows
    asked: Mapping[str, Any] = field(default_factory=dict)
    regions: Rows | None = None
    disagreements: Rows | None = None
    own_names: Mapping[str, str] = field(default_factory=dict)


def variants_as_sides(whole: Side, chosen: Sequence[str] | None = None) -> list[Side]:
    """Return the variants of one result as results of their own, the base first.

    Parameters
    ----------
    whole
        The result.
    chosen
        Variants in order; all but the baseline by default, ``unfiltered`` first.

    Raises
    ------
    ComparisonError
        If a variant is not there, or fewer than two are.
    """
    frames, drive = whole.frames, whole.drive
    there = frames.distinct("variant")
    pipelines = sorted((n for n in there if n != BASELINE), key=lambda name: name != UNFILTERED)
    names = list(chosen or pipelines)
    for name in names:
        if name not in there:
            raise ComparisonError(f"{drive}: no variant {name}; there are {', '.join(there)}")
    if len(names) < 2:
        raise ComparisonError(
            f"{drive}: {len(names)} variant to compare; two are needed, or a second result"
        )
    return [replace(whole, label=name, frames=frames.of_variant(name)) for name in names]


def compare(
    sides: Sequence[Side], settings: EvaluationSettings, *, across_variants: bool = False
) -> Comparison:
    """Compare results with the first of them.

    Parameters
    ----------
    sides
        Two at least, the base first.
    settings
        Confidence and the rest of the intervals' making.
    across_variants
        Whether each side is one variant of the same result, to be matched with another one.

    Raises
    ------
    ComparisonError
        If a result has nothing to compare, or two have no frame in common.
    """
    for side in sides:
        if not len(side.frames):
            raise ComparisonError(f"{side.label}: nothing was scored, so nothing can be compared")
    results = tuple(_result(side) for side in sides)
    base, *others = sides
    if base.digest is None or len({side.digest for side in sides}) > 1:
        levels = tuple(row for side in sides for row in _levels(side))
        return Comparison(False, results, levels, levels, (), (_why_apart(sides),), settings)
    pairs = [_Pair(base, new, settings, across_variants=across_variants) for new in others]
    return Comparison(
        same_drive=True,
        results=results,
        changes=_corrected([row for pair in pairs for row in pair.changes()]),
        levels=tuple(row for side in others for row in _levels(side)),
        moved=tuple(frame for pair in pairs for frame in pair.moved()),
        regions=_corrected_regions([row for pair in pairs for row in pair.regions()]),
        disagreements=tuple(frame for pair in pairs for frame in pair.disagreements()),
        notes=tuple(note for pair in pairs for note in pair.notes()),
        settings=settings,
    )


def _corrected(rows: Sequence[MaskComparison]) -> tuple[MaskComparison, ...]:
    """Correct the changes of ERR, of every variant and stage, for how many they are."""
    found = holm([row.difference["ERR"] for row in rows])
    return tuple(
        replace(row, difference={**row.difference, "ERR": change})
        for row, change in zip(rows, found, strict=True)
    )


def _corrected_regions(rows: Sequence[RegionComparison]) -> tuple[RegionComparison, ...]:
    """Correct the changes of ERR in regions for how many they are."""
    found = holm([row.difference for row in rows])
    return tuple(replace(row, difference=each) for row, each in zip(rows, found, strict=True))


class _Pair:
    """A base and a new result of the same drive, on the frames that both evaluated."""

    def __init__(
        self, base: Side, new: Side, settings: EvaluationSettings, *, across_variants: bool
    ) -> None:
        self._base, self._new, self._settings = base, new, settings
        self._across = across_variants
        self._common = common_masks(base.frames, new.frames, new.label if across_variants else None)
        if not self._common:
            raise ComparisonError(
                f"{base.label} and {new.label} have no evaluated frame and stage in common"
            )
        self._finals = final_stages((mask.variant, mask.stage) for mask in self._common)

    def changes(self) -> Iterator[MaskComparison]:
        """Yield a row for each variant and stage that both have."""
        for mask in self._common:
            yield MaskComparison(
                result=self._new.label,
                variant=mask.variant,
                stage=mask.stage,
                final=mask.stage == self._finals[mask.variant],
                frames=len(mask.after),
                base=_rates(mask.before),
                new=_rates(mask.after),
                difference={
                    name: mean_difference(mask.after[name], mask.before[name], self._settings)
                    for name in COMPARED
                },
            )

    def moved(self) -> Iterator[MovedFrame]:
        """Yield the frames whose final ERR changed most, the first variant's."""
        first = next(iter(self._finals.items()))
        (mask,) = (each for each in self._common if (each.variant, each.stage) == first)
        after, base = mask.after, mask.before["ERR"]
        changes = after["ERR"] - base
        for harmed in (True, False):
            places = scored.most_changed(after["stamp_ns"], changes, MOVED, harmed=harmed)
            for place in places.tolist():
                was, change = float(base[place]), float(changes[place])
                yield MovedFrame(
                    result=self._new.label,
                    variant=mask.variant,
                    frame=int(after["frame"][place]),
                    stamp_ns=int(after["stamp_ns"][place]),
                    base=was,
                    new=was + change,
                    change=change,
                )

    def regions(self) -> Iterator[RegionComparison]:
        """Yield what changed by region and shade, of the final masks that look at the image."""
        base, new = self._base.regions, self._new.regions
        if base is None or new is None:
            return
        for mask in self._common:
            if mask.stage == self._finals[mask.variant] and mask.variant != BASELINE:
                own = self._base.label if self._across else mask.variant
                before = where.region_counts(base, own, mask.stage, mask.before["frame"])
                after = where.region_counts(new, mask.variant, mask.stage, mask.after["frame"])
                names = {"result": self._new.label, "variant": mask.variant}
                yield from where.by_region(before, after, self._settings, **names)
                rates = mask.before, mask.after
                yield from where.by_shade(before, after, rates, self._settings, **names)

    def disagreements(self) -> Iterator[Disagreement]:
        """Yield the frames on which two variants of a run disagree most."""
        table = self._new.disagreements
        if table is not None and self._across:
            frames = next(mask.after for mask in self._common)
            yield from where.disagreements(table, frames, self._base.label, self._new.label)

    def notes(self) -> Iterator[Note]:
        """Yield what was left out, and what makes the two less comparable than they look."""
        base, new = self._base, self._new
        both = len(set().union(*(mask.keys for mask in self._common)))
        for side, other in ((base, new), (new, base)):
            rest = len(side.frames.distinct("frame")) - both
            if rest:
                yield FramesLeftOut(side.label, other.label, rest)
        compared = {mask.variant for mask in self._common}
        for variant in [] if self._across else base.frames.distinct("variant"):
            if variant not in compared and variant in new.frames.distinct("variant"):
                yield VariantLeftOut(base.label, new.label, variant)
        settings = _differing(base.asked, new.asked)
        if settings:
            yield SettingsDiffer(base.label, new.label, settings)
        frames = self._relabelled()
        if frames:
            yield TruthDiffers(base.label, new.label, frames, bool(settings))

    def _relabelled(self) -> int:
        """Count the frames whose truth differs."""
        keys = (
            key
            for mask in self._common
            for key, differs in zip(mask.keys, mask.truth_differs, strict=True)
            if differs
        )
        return len(set(keys))


def _differing(base: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Return both values of the settings that two results know and differ in."""
    return {
        name: (base[name], new[name]) for name in base if name in new and base[name] != new[name]
    }


def _rates(rows: Rows) -> dict[str, float]:
    """Sum up rows of one mask: mean and pooled metrics, and those of the overlap."""
    total = sum_up(scored.counts(rows))
    names = (*METRICS, *(f"pooled_{name}" for name in METRICS))
    return {name: total[name] for name in names} | scored.overlap(total)


def _levels(side: Side) -> Iterator[MaskComparison]:
    last = scored.final_stages(side.frames)
    for variant, stage, places in side.frames.masks():
        new, final = _rates(side.frames.take(places)), stage == last[variant]
        yield MaskComparison(side.label, variant, stage, final, len(places), {}, new, {})


def _result(side: Side) -> ComparedResult:
    frames, scale = len(side.frames.distinct("frame")), side.asked.get("frames.scale")
    return ComparedResult(side.label, side.drive, side.digest, frames, scale)


def _why_apart(sides: Sequence[Side]) -> Note:
    for side in sides:
        if side.digest is None:
            return LogUnknown(side.label)
    a, b = next((a, b) for a, b in pairwise(sides) if a.digest != b.digest)
    return DrivesDiffer(a.label, b.label)
