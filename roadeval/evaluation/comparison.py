"""Two or more results side by side: what changed, on the same frames, and how sure that is.

Results of the same log are matched frame by frame, by their stamps; a frame that either trained
on, or that either lacks, is left out of both. Results of different logs are only put side by side:
a difference between them would mix the scene with the method.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE
from roadeval.errors import RoadevalError
from roadeval.evaluation import analysis
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import mean_difference
from roadeval.jobs.asked import TELLING

if TYPE_CHECKING:
    import pandas as pd

FORMAT: Final = {"name": "roadeval-comparison", "version": 1}
COMPARED: Final = tuple(name for name, metric in METRICS.items() if metric.mirrors is None)
"""The metrics whose differences are given."""
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
    selection
        What was asked of the log, by the options' names; empty where the result does not know it.
    """

    label: str
    drive: str
    digest: str | None
    frames: pd.DataFrame
    selection: Mapping[str, Any] = field(default_factory=dict)


def variants_as_sides(
    frames: pd.DataFrame, drive: str, digest: str | None, chosen: Sequence[str] | None = None
) -> list[Side]:
    """Take the variants of one result for results of their own; the first is the base.

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
    names = list(chosen or sorted((n for n in there if n != BASELINE), key=_unfiltered_first))
    for name in names:
        if name not in there:
            raise ComparisonError(f"{drive}: no variant {name}; there are {', '.join(there)}")
    if len(names) < 2:
        raise ComparisonError(
            f"{drive}: {len(names)} variant to compare; two are needed, or a second result"
        )
    return [Side(name, drive, digest, frames[frames["variant"] == name]) for name in names]


def _unfiltered_first(name: str) -> bool:
    return name != "unfiltered"


def compare(
    sides: Sequence[Side], settings: EvaluationSettings, *, across_variants: bool = False
) -> dict[str, Any]:
    """Compare results with the first of them.

    Parameters
    ----------
    sides
        Two at least, the base first.
    settings
        Confidence and the rest of the intervals' making.
    across_variants
        Whether each side is one variant of the same result, to be matched with another one.

    Returns
    -------
    dict
        The content of the comparison's JSON file: ``format``, ``same_drive``, ``results``,
        ``changes`` (a row per new result, variant and stage, of the frames that both evaluated),
        ``levels`` (the same of all of its own frames, whatever the base lacks), ``moved`` (the
        frames that changed most) and ``warnings``. For different drives ``changes`` and ``levels``
        have rows of every result.

    Raises
    ------
    ComparisonError
        If a result has nothing to compare, or two have no frame in common.
    """
    for side in sides:
        if not len(side.frames):
            raise ComparisonError(f"{side.label}: nothing was scored, so nothing can be compared")
    same = len({side.digest for side in sides}) == 1 and sides[0].digest is not None
    found: dict[str, Any] = {
        "format": FORMAT,
        "same_drive": same,
        "results": [
            {
                "label": side.label,
                "drive": side.drive,
                "sha256": side.digest,
                "frames": side.frames["frame"].nunique(),
                "scale": side.selection.get("scale"),
            }
            for side in sides
        ],
    }
    levels = [row for side in (sides[1:] if same else sides) for row in _levels(side)]
    if not same:
        return found | {
            "changes": levels,
            "levels": levels,
            "moved": [],
            "warnings": [_apart(sides)],
        }
    pairs = [_Pair(sides[0], new, settings, across_variants=across_variants) for new in sides[1:]]
    return found | {
        "changes": [row for pair in pairs for row in pair.changes()],
        "levels": levels,
        "moved": [row for pair in pairs for row in pair.moved()],
        "warnings": [sentence for pair in pairs for sentence in pair.warnings()],
    }


class _Pair:
    """A base and a new result of the same drive, on the frames that both evaluated."""

    def __init__(
        self, base: Side, new: Side, settings: EvaluationSettings, *, across_variants: bool
    ) -> None:
        self._base, self._new, self._settings = base, new, settings
        before = base.frames
        if across_variants:
            before = before.assign(variant=new.label)
        keys = ["stamp", "variant", "stage"]
        matched = _stamped(before).merge(_stamped(new.frames), on=keys, suffixes=("_base", ""))
        if not len(matched):
            raise ComparisonError(
                f"{base.label} and {new.label} have no evaluated frame and stage in common"
            )
        self._matched = matched
        self._last = analysis.final_stages(matched)

    def changes(self) -> Iterator[dict[str, Any]]:
        """Yield a row for each variant and stage that both have."""
        for variant, stage, rows in _by_mask(self._matched):
            before = rows[["frame", *(f"{c}_base" for c in (*analysis.OUTCOMES, *METRICS))]]
            before = before.rename(columns=lambda name: name.removesuffix("_base"))
            rates = COMPARED if stage == self._last[variant] else COMPARED[:1]
            yield {
                "result": self._new.label,
                "variant": variant,
                "stage": stage,
                "final": stage == self._last[variant],
                "frames": len(rows),
                "base": _rates(before.assign(variant=variant, stage=stage)),
                "new": _rates(rows),
                "difference": {
                    rate: asdict(
                        mean_difference(
                            (rows[rate] - rows[f"{rate}_base"]).to_numpy(float), self._settings
                        )
                    )
                    for rate in rates
                },
            }

    def moved(self) -> Iterator[dict[str, Any]]:
        """Yield the frames whose final ERR changed most, the first variant's."""
        variant = next(iter(self._last))
        rows = analysis.finals(self._matched)
        rows = rows[rows["variant"] == variant].assign(change=lambda r: r["ERR"] - r["ERR_base"])
        paired = rows.drop(columns="ERR").rename(columns={"change": "ERR"}).set_index("frame")
        for harmed in (True, False):
            found = analysis.most_changed(paired, MOVED, harmed=harmed)
            for row in found.to_dict("records"):
                yield {
                    "result": self._new.label,
                    "variant": variant,
                    "frame": row["frame"],
                    "stamp_ns": row["stamp_ns"],
                    "base": row["ERR_base"],
                    "new": row["ERR_base"] + row["ERR"],
                    "change": row["ERR"],
                }

    def warnings(self) -> Iterator[str]:
        """Say what was left out, and what makes the two less comparable than they look."""
        base, new = self._base, self._new
        both = self._matched["stamp"].nunique()
        for side in (base, new):
            rest = side.frames["frame"].nunique() - both
            if rest:
                yield (
                    f"{rest} frames that {side.label} evaluated are left out against "
                    f"{(new if side is base else base).label}, which lacks them or trained on them"
                )
        if options := _differing(base.selection, new.selection):
            yield (
                f"{base.label} and {new.label} were replayed with different options "
                f"({', '.join(options)}): part of the change may be theirs"
            )
        truths = self._matched[["TP", "FN", "N"]].sum(axis=1) != self._matched[
            ["TP_base", "FN_base", "N_base"]
        ].sum(axis=1)
        if truths.any():
            guess = "" if options else " (other labels or topics?)"
            yield (
                f"the truth differs on {self._matched[truths]['stamp'].nunique()} frames between "
                f"{base.label} and {new.label}{guess}: part of the change may be the truth's"
            )


def _differing(base: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Name the options of `TELLING` that two results know and differ in, with both values."""
    return [
        f"{option} {_said(base[name])} and {_said(new[name])}"
        for name, option in TELLING.items()
        if name in base and name in new and base[name] != new[name]
    ]


def _said(value: Any) -> str:
    """Write an option's value for a person."""
    if value is None or value in ({}, [], ()):
        return "not given"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _by_mask(frames: pd.DataFrame) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Yield each variant and stage with its rows, in the table's order."""
    for (variant, stage), rows in frames.groupby(["variant", "stage"], sort=False):
        yield str(variant), str(stage), rows


def _stamped(frames: pd.DataFrame) -> pd.DataFrame:
    """Add a key to match frames by: the stamp, and among equal ones the place."""
    place = frames.groupby(["variant", "stage", "stamp_ns"], sort=False).cumcount()
    return frames.assign(stamp=frames["stamp_ns"].astype(str) + "/" + place.astype(str))


def _rates(rows: pd.DataFrame) -> dict[str, Any]:
    """Sum up rows of one variant and stage: mean and pooled rates, IoU, F1 and precision."""
    (history,) = analysis.histories(rows)
    total = history.totals()
    named = {name: total[name] for name in (*METRICS, *(f"pooled_{rate}" for rate in METRICS))}
    return named | analysis.overlap(total)


def _levels(side: Side) -> Iterator[dict[str, Any]]:
    last = analysis.final_stages(side.frames)
    for variant, stage, rows in _by_mask(side.frames):
        yield {
            "result": side.label,
            "variant": variant,
            "stage": stage,
            "final": stage == last[variant],
            "frames": len(rows),
            "base": {},
            "new": _rates(rows),
            "difference": {},
        }


def _apart(sides: Sequence[Side]) -> str:
    for side in sides:
        if side.digest is None:
            return f"{side.label} does not say which log it is of: nothing is subtracted"
    a, b = next((a, b) for a, b in pairwise(sides) if a.digest != b.digest)
    return (
        f"{a.label} and {b.label} are of different drives: side by side only, for a difference "
        "would mix the scene with the method"
    )
