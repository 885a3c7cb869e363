"""Why a variant fails, in a few sentences: what is confirmed, and the frames that show it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from roadeval.data import BASELINE
from roadeval.data.words import percent
from roadeval.evaluation.score.degradation import Degradations
from roadeval.evaluation.stats.slices import FrameCondition, Slice
from roadeval.evaluation.tables import by_class, only
from roadeval.results.facts import Facts, FleetFacts, Reason
from roadeval.results.schema import TAG
from roadeval.results.sentences import is_significant

if TYPE_CHECKING:
    import pandas as pd

TIMES: Final = 1.5
"""Least ratio of two error rates that a sentence states as a ratio."""
MOST: Final = 4
"""Greatest number of reasons for the errors of a variant."""


def explain(facts: Facts | FleetFacts, classes: pd.DataFrame) -> dict[str, list[Reason]]:
    """Return the confirmed reasons for the errors of each variant that has some.

    They name the class of its false road and the class beside its missed road, the condition under
    which it errs most, and the disturbance that harms it most. Nothing is explained if truth or
    masks do not fit the images. ``classes`` are the rows of the table of that name.
    """
    why: dict[str, list[Reason]] = {}
    for variant in facts.finals if not facts.misfits else ():
        if variant == BASELINE:
            continue
        reasons, rows = [], only(classes, variant=variant)
        for kind, sentence in describe_classes(rows, variant).items():
            frames: list[int] = []
            if isinstance(facts, Facts):  # frames with the most false or missed road of a class
                is_kind = rows["truth"] == ("other" if kind == "false" else "road")
                wrong = rows["road"] if kind == "false" else rows["pixels"] - rows["road"]
                most = wrong.where(is_kind, -1).to_numpy().argmax()
                frames = [*map(int, str(rows["worst"].iloc[most]).split())]
            reasons.append(Reason(sentence, frames))
        # Regions tell already if one part of the image is worse than the rest.
        slices = (part for part in facts.slices.get(variant, []) if part.conditions)
        if part := next(slices, None):
            reasons.append(Reason(describe_slice(part), [] if part.drives else part.worst))
        changes = facts.disturbances.get(variant, {})
        if any(is_significant(change.difference) for change in changes.values()):
            reasons.append(Reason(describe_disturbances({variant: changes}, variant), []))
        if reasons:
            why[variant] = reasons[:MOST]
    return why


def with_doubts(facts: Facts, sentences: Sequence[str]) -> Facts:
    """Return facts with sentences on the labels before the reasons of each variant.

    Doubts about the truth come first, as all other reasons rest on it; at most `MOST` are kept.
    """
    doubts = [Reason(sentence, []) for sentence in sentences]
    variants = (name for name in facts.finals if name != BASELINE)
    why = {name: [*doubts, *facts.why.get(name, [])][:MOST] for name in variants}
    return replace(facts, why=why) if doubts else facts


NAMED: Final = 3
"""Greatest number of classes that a sentence names."""
LEAST_WRONG: Final = 0.001
"""Less false road, or missed road, than this share of the pixels makes no sentence."""
LEAST_SHARE: Final = 0.25
"""No sentence is about a class with a smaller share of the false, or missed, road."""
LEAST_OTHER: Final = 0.1
"""A class with a smaller share is not named beside another."""


def describe_classes(classes: pd.DataFrame, variant: str) -> dict[str, str]:
    """Return which classes a variant calls road, and which classes lie beside its missed road.

    The sentences have the names ``false`` and ``missed``; rare errors have none. ``classes`` are
    the rows of the table of that name, of any number of drives.
    """
    rows = only(classes, variant=variant)
    pixels, is_road = rows["pixels"], rows["truth"] == "road"
    is_other, drives = rows["truth"] == "other", rows["drive"].nunique()
    least = max(1, LEAST_WRONG * pixels[is_road | is_other].sum())
    over = f" (mean of {drives} drives)" if drives > 1 else ""
    sentences = {}
    for kind, wrong, verb, beside in (
        ("false", rows["road"][is_other], "is", ""),
        ("missed", (pixels - rows["road"])[is_road], "lies beside", "beside "),
    ):
        if wrong.sum() >= least:
            shares = by_class(rows)[kind].sort_values(ascending=False, kind="stable")
            (first, most), *others = shares.head(NAMED).items()
            if most < LEAST_SHARE:
                continue
            parts = [f"{percent(most, 0)} % of the {kind} road {verb} {first}"]
            named = [(name, part) for name, part in others if part >= LEAST_OTHER]
            parts += [f"{percent(part, 0)} % {beside}{name}" for name, part in named]
            sentences[kind] = f"{', '.join(parts)}{over}."
    return sentences


_QUANTITIES: Final = {
    "brightness": ("with a brightness {} {} %", "below", "above"),
    "contrast": ("with a contrast {} {} %", "below", "above"),
    "shadow": ("with {} {} % shade", "less than", "more than"),
    "blur": ("with a blur {} {} %", "below", "above"),
    "change": ("that differ by {} {} % from the frame before", "less than", "more than"),
    "road_share": ("with {} {} % road", "less than", "more than"),
    "curvature": ("with a road bent by {} {} % of the width", "less than", "more than"),
    "seconds": ("{} {} s of the drive", "in the first", "after"),
    "hour": ("{} {} UTC", "before", "after"),
}
"""Words behind "frames" for each quantity, and words for below and above its limit."""


def describe_condition(condition: FrameCondition) -> str:
    """Return a condition as words behind "frames".

    >>> describe_condition(FrameCondition("shadow", ">", 0.3))
    'with more than 30 % shade'
    >>> describe_condition(FrameCondition("hour", "<", 17.5))
    'before 17:30 UTC'
    """
    name, limit = condition.quantity, condition.limit
    if isinstance(limit, str):
        return f"with {name.removeprefix(TAG)} {limit}"
    words, below, above = _QUANTITIES.get(name, (f"with {name} {{}} {{}}", "below", "above"))
    text = f"{100 * limit if '%' in words else limit:g}"
    if name == "hour":
        text = f"{int(limit):02d}:{round(limit % 1 * 60):02d}"
    return words.format(below if condition.operator == "<" else above, text)


def describe_part(part: str) -> str:
    """Return where a part of the image lies.

    >>> describe_part("20-80m"), describe_part("rows_40-60"), describe_part("left")
    ('20 to 80 m ahead', '40 to 60 % down the image', 'in the left half of the image')
    """
    if match := re.fullmatch(r"(\d+)-(\d+)m", part):
        return f"{match[1]} to {match[2]} m ahead"
    if match := re.fullmatch(r"rows_(\d+)-(\d+)", part):
        return f"{match[1]} to {match[2]} % down the image"
    return f"in the {part} half of the image" if part in ("left", "right") else part


def describe_slice(failure: Slice) -> str:
    """Return where ERR is higher, and by how much, as a sentence.

    >>> shade = FrameCondition("shadow", ">", 0.3)
    >>> describe_slice(Slice([shade], "20-80m", 90, 0.31, 0.1, 3.1, 1.8, 4.9, 0.01))
    'In frames with more than 30 % shade, 20 to 80 m ahead, ERR is 3.1 times the rest (1.8 to 4.9).'
    """
    words = describe_place(failure)
    return (
        f"{words[0].upper()}{words[1:]}, ERR is {failure.ratio:.1f} times the rest "
        f"({failure.low:.1f} to {failure.high:.1f})."
    )


def describe_place(failure: Slice) -> str:
    """Return the frames of a slice, and its part of the image, in words."""
    conditions = " and ".join(map(describe_condition, failure.conditions))
    frames = f"in frames {conditions}" * bool(conditions)
    return ", ".join(filter(None, (frames, describe_part(failure.part))))


def describe_disturbances(disturbances: Degradations, focus: str | None) -> str:
    """Return which disturbance harms the focus most, and how many do; empty without any.

    If the focus was not disturbed, the sentence is about the first variant that was.
    """
    if not disturbances:
        return ""
    variant = focus if focus in disturbances else next(iter(disturbances))
    changes = [change for change in disturbances[variant].values() if change.strength]
    worse = [change for change in changes if change.difference.mean > 0]
    if not worse:
        return f"No disturbance makes {variant} worse."
    sure = [change for change in worse if is_significant(change.difference)]
    worst = max(worse, key=lambda change: change.difference.mean)
    base, error = worst.base_ERR or 0.0, worst.ERR or 0.0
    times = f" ({error / base:.2g} times as high)" if 0 < TIMES * base <= error else ""
    ends = f"from {percent(base, 1)} to {percent(error, 1)} %"
    others = f" {len(worse)} of {len(changes)} disturbances raise it, {len(sure)} beyond chance."
    first = f"{worst.text} raises the ERR of {variant} {ends}{times}."
    return f"{first}{others * (len(changes) > 1)}"
