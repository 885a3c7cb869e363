"""A comparison for people and machines: its sentences, and the content of its JSON file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any, Final

from roadeval.data import BASELINE
from roadeval.data.words import percent, plain_points
from roadeval.evaluation.comparison_result import (
    Comparison,
    DrivesDiffer,
    EndMissing,
    FramesLeftOut,
    LogUnknown,
    MaskComparison,
    Note,
    SettingsDiffer,
    TruthDiffers,
    VariantLeftOut,
)
from roadeval.evaluation.conditions import Judgement
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.certainty import Degree, degree_of, stands, too_few

FORMAT: Final = {"name": "roadeval-comparison", "version": 1}


def as_dict(comparison: Comparison, judgements: Sequence[Judgement] = ()) -> dict[str, Any]:
    """Return the content of a comparison's JSON file: its facts, and the sentences on them."""
    facts = asdict(comparison)
    notes = [
        {"kind": type(note).__name__, **fact}
        for note, fact in zip(comparison.notes, facts.pop("notes"), strict=True)
    ]
    return {
        "format": FORMAT,
        "verdict": verdict(comparison),
        "where": where(comparison),
        **facts,
        "notes": notes,
        "warnings": warnings(comparison),
        "conditions": [_condition(each) for each in judgements],
    }


def verdict(comparison: Comparison) -> str:
    """Return whether results are better or worse than the base, and how sure that is."""
    if not comparison.same_drive:
        return "Different drives, side by side: no difference is given."
    finals = [row for row in comparison.changes if row.final]
    # The baseline never looks at the image: its change tells nothing of a method.
    told = [row for row in finals if row.variant != BASELINE] or finals
    base, settings = comparison.results[0].label, comparison.settings
    changes = "; ".join(_change(row, settings) for row in told)
    return f"Against {base}: {changes} ({percent(settings.confidence, 0)} % intervals)."


def where(comparison: Comparison) -> list[str]:
    """Return where final masks are surely better or worse, and where they disagree."""
    masks = dict.fromkeys((row.result, row.variant) for row in comparison.regions)
    return [
        *(_by_region(comparison, *mask) for mask in masks),
        *_disagreements(comparison),
    ]


def _by_region(comparison: Comparison, result: str, variant: str) -> str:
    rows = [r for r in comparison.regions if (r.result, r.variant) == (result, variant)]
    sure = [r for r in rows if stands(r.difference.p_holm, r.difference.confidence)]
    parts = []
    for word, sign in (("better", -1), ("worse", 1)):
        names = [r.title for r in sure if sign * r.difference.mean > 0]
        if len(names) == len(rows):
            parts.append(f"{word} everywhere")
        elif names:
            parts.append(f"{word} ({'; '.join(names)})")
    name = result if result == variant else f"{variant} of {result}"
    return f"{name} by region and shade: {', '.join(parts) or 'no change is sure in any'}"


def _disagreements(comparison: Comparison) -> Iterator[str]:
    for result in dict.fromkeys(each.result for each in comparison.disagreements):
        first, *rest = (each for each in comparison.disagreements if each.result == result)
        most = percent(first.base_right + first.new_right, 1)
        frames = [f"{first.frame} ({most} % of the pixels)", *(str(each.frame) for each in rest)]
        yield f"{result} disagrees most on frames {', '.join(frames)}"


def warnings(comparison: Comparison) -> list[str]:
    """Return what was left out and what makes results less comparable than they look."""
    return [note(each) for each in comparison.notes]


def judged(judgement: Judgement) -> str:
    """Return what was found of a condition, and whether it holds."""
    condition = judgement.condition
    rate = f"{condition.stage}.{condition.variant}.{condition.rate} of {judgement.result}"
    holds = "holds" if judgement.holds else "does not hold"
    after = f"{percent(judgement.after)} %"
    if not condition.is_change:
        return f"{rate} is {after}: {condition.text} {holds}"
    change = f"{plain_points(judgement.after - judgement.before)} pp"
    if condition.surely:
        change += f" [{plain_points(judgement.low)}, {plain_points(judgement.high)}]"
    before = f"{percent(judgement.before)} %"
    return f"{rate} changed by {change} ({before} to {after}): {condition.text} {holds}"


def _condition(judgement: Judgement) -> dict[str, Any]:
    """Return the facts of a judged condition, and the sentence on them."""
    facts = asdict(judgement)
    return {**facts.pop("condition"), **facts, "sentence": judged(judgement)}


def _change(row: MaskComparison, settings: EvaluationSettings) -> str:
    """Return in a clause what happened to the ERR of a mask, and how sure that is."""
    change = row.difference["ERR"]
    name = row.result if row.result == row.variant else f"{row.variant} of {row.result}"
    better = "worse" if change.mean > 0 else "better"
    mean = f"ERR {plain_points(change.mean)} pp"
    sure = f"{mean} [{plain_points(change.low)}, {plain_points(change.high)}]"
    most = percent(max(-(change.low or 0), change.high or 0))
    clauses = {
        Degree.UNDEFINED: f"{name}: ERR is undefined on every frame",
        Degree.FEW: f"{name}: {too_few(change.frames)}, {mean}",
        Degree.SAME: f"{name} has the same ERR on every frame",
        Degree.SURE: f"{name} is {better}, {sure}",
        Degree.LITTLE: f"{name} is neither better nor worse by more than {most} pp, {sure}",
        Degree.PROBABLE: f"{name} is probably {better}, {sure}",
        Degree.UNKNOWN: f"{name}: cannot tell, {sure}",
    }
    return clauses[degree_of(change, settings)]


def note(told: Note) -> str:
    """Return a note on a comparison as a clause."""
    match told:
        case FramesLeftOut(result, other, frames):
            said = (
                f"{frames} frames that {result} evaluated are left out against {other}, which "
                "lacks them or trained on them"
            )
        case VariantLeftOut(base, new, variant):
            said = f"{variant} is left out: {base} and {new} have it on no frame both"
        case SettingsDiffer(base, new, settings):
            both = (f"`{name}` {_value(a)} and {_value(b)}" for name, (a, b) in settings.items())
            said = (
                f"{base} and {new} were replayed with different settings ({', '.join(both)}): "
                "part of the change may be theirs"
            )
        case TruthDiffers(base, new, frames, settings_differ):
            guess = "" if settings_differ else " (other labels or topics?)"
            said = (
                f"the truth differs on {frames} frames between {base} and {new}{guess}: part of "
                "the change may be the truth's"
            )
        case LogUnknown(result):
            said = f"{result} does not say which log it is of: nothing is subtracted"
        case EndMissing(result):
            said = f"{result} is a partial recording: the end of its drive is missing"
        case DrivesDiffer(result, other):
            said = (
                f"{result} and {other} are of different drives: side by side only, for a "
                "difference would mix the scene with the method"
            )
    return said


def _value(value: Any) -> str:
    """Write a setting's value for a person."""
    if value is None or value in ({}, [], ()):
        return "not given"
    return f"{value:g}" if isinstance(value, float) else str(value)
