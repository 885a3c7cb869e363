"""Comparison of results: what changed on the same frames, with intervals.

Results of the same log are matched frame by frame, by their stamps; a frame that either trained
on, or that either lacks, is left out of both. Results of different logs are only put side by side:
a difference between them would mix the scene with the method.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE, UNFILTERED
from roadeval.errors import RoadevalError
from roadeval.evaluation import analysis
from roadeval.evaluation.comparison_result import (
    ComparedResult,
    Comparison,
    DrivesDiffer,
    FramesLeftOut,
    LogUnknown,
    MaskComparison,
    MovedFrame,
    Note,
    SettingsDiffer,
    TruthDiffers,
)
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import holm, mean_difference

if TYPE_CHECKING:
    import pandas as pd

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
    """

    label: str
    drive: str
    digest: str | None
    frames: pd.DataFrame
    asked: Mapping[str, Any] = field(default_factory=dict)


def variants_as_sides(
    frames: pd.DataFrame, drive: str, digest: str | None, chosen: Sequence[str] | None = None
) -> list[Side]:
    """Return the variants of one result as results of their own, the base first.

    Parameters
    ----------
    frames
        The result's table.
    drive, digest
        As in `Side`.
    chosen
        Variants in order; all but the baseline by default, ``unfiltered`` first.

    Raises
    ------
    ComparisonError
        If a variant is not there, or fewer than two are.
    """
    there = frames["variant"].unique().tolist() if len(frames) else []
    pipelines = sorted((n for n in there if n != BASELINE), key=lambda name: name != UNFILTERED)
    names = list(chosen or pipelines)
    for name in names:
        if name not in there:
            raise ComparisonError(f"{drive}: no variant {name}; there are {', '.join(there)}")
    if len(names) < 2:
        raise ComparisonError(
            f"{drive}: {len(names)} variant to compare; two are needed, or a second result"
        )
    return [Side(name, drive, digest, frames[frames["variant"] == name]) for name in names]


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


class _Pair:
    """A base and a new result of the same drive, on the frames that both evaluated.

    The rows of both, in the base's order, are indexed alike: by stamp, variant and stage.
    """

    def __init__(
        self, base: Side, new: Side, settings: EvaluationSettings, *, across_variants: bool
    ) -> None:
        self._base, self._new, self._settings = base, new, settings
        frames = base.frames.assign(variant=new.label) if across_variants else base.frames
        before, after = _stamped(frames), _stamped(new.frames)
        both = before.index.intersection(after.index, sort=False)
        if not len(both):
            raise ComparisonError(
                f"{base.label} and {new.label} have no evaluated frame and stage in common"
            )
        self._before, self._after = before.loc[both], after.loc[both]

    def changes(self) -> Iterator[MaskComparison]:
        """Yield a row for each variant and stage that both have."""
        for variant, stage, final, after in _by_mask(self._after):
            before = self._before.loc[after.index]
            yield MaskComparison(
                result=self._new.label,
                variant=variant,
                stage=stage,
                final=final,
                frames=len(after),
                base=_rates(before),
                new=_rates(after),
                difference={
                    name: mean_difference(
                        after[name].to_numpy(float), before[name].to_numpy(float), self._settings
                    )
                    for name in COMPARED
                },
            )

    def moved(self) -> Iterator[MovedFrame]:
        """Yield the frames whose final ERR changed most, the first variant's."""
        variant, stage = next(iter(analysis.final_stages(self._after).items()))
        after = self._after[(self._after["variant"] == variant) & (self._after["stage"] == stage)]
        before = self._before.loc[after.index, "ERR"]
        paired = after[["frame", "stamp_ns"]].assign(base=before, ERR=after["ERR"] - before)
        for harmed in (True, False):
            most = analysis.most_changed(paired.set_index("frame"), MOVED, harmed=harmed)
            for row in most.to_dict("records"):
                yield MovedFrame(
                    result=self._new.label,
                    variant=variant,
                    frame=row["frame"],
                    stamp_ns=row["stamp_ns"],
                    base=row["base"],
                    new=row["base"] + row["ERR"],
                    change=row["ERR"],
                )

    def notes(self) -> Iterator[Note]:
        """Yield what was left out, and what makes the two less comparable than they look."""
        base, new = self._base, self._new
        both = self._after["stamp"].nunique()
        for side, other in ((base, new), (new, base)):
            rest = side.frames["frame"].nunique() - both
            if rest:
                yield FramesLeftOut(side.label, other.label, rest)
        settings = _differing(base.asked, new.asked)
        if settings:
            yield SettingsDiffer(base.label, new.label, settings)
        differs = _truths(self._after).ne(_truths(self._before)).any(axis=1)
        if differs.any():
            frames = self._after["stamp"][differs].nunique()
            yield TruthDiffers(base.label, new.label, frames, bool(settings))


def _differing(base: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Return both values of the settings that two results know and differ in."""
    return {
        name: (base[name], new[name]) for name in base if name in new and base[name] != new[name]
    }


def _truths(frames: pd.DataFrame) -> pd.DataFrame:
    """Return each row's road and labelled pixels of the truth, whatever the mask made of them."""
    return frames[["N"]].assign(road=frames["TP"] + frames["FN"])


def _stamped(frames: pd.DataFrame) -> pd.DataFrame:
    """Index rows by stamp, variant and stage; equal stamps are told apart by their order."""
    import pandas as pd

    place = frames.groupby(["variant", "stage", "stamp_ns"], sort=False).cumcount()
    stamp = frames["stamp_ns"].astype(str) + "/" + place.astype(str)
    keys = [stamp, frames["variant"], frames["stage"]]
    return frames.assign(stamp=stamp).set_index(pd.MultiIndex.from_arrays(keys, names=[None] * 3))


def _by_mask(frames: pd.DataFrame) -> Iterator[tuple[str, str, bool, pd.DataFrame]]:
    """Yield each variant and stage, whether that is its final one, and its rows, in order."""
    last = analysis.final_stages(frames)
    for (variant, stage), rows in frames.groupby(["variant", "stage"], sort=False):
        yield str(variant), str(stage), stage == last[str(variant)], rows


def _rates(rows: pd.DataFrame) -> dict[str, float]:
    """Sum up rows of one mask: mean and pooled metrics, and those of the overlap."""
    total = analysis.sum_up_rows(rows)
    names = (*METRICS, *(f"pooled_{name}" for name in METRICS))
    return {name: total[name] for name in names} | analysis.overlap(total)


def _levels(side: Side) -> Iterator[MaskComparison]:
    for variant, stage, final, rows in _by_mask(side.frames):
        new = _rates(rows)
        yield MaskComparison(side.label, variant, stage, final, len(rows), {}, new, {})


def _result(side: Side) -> ComparedResult:
    frames, scale = side.frames["frame"].nunique(), side.asked.get("frames.scale")
    return ComparedResult(side.label, side.drive, side.digest, frames, scale)


def _why_apart(sides: Sequence[Side]) -> Note:
    for side in sides:
        if side.digest is None:
            return LogUnknown(side.label)
    a, b = next((a, b) for a, b in pairwise(sides) if a.digest != b.digest)
    return DrivesDiffer(a.label, b.label)
