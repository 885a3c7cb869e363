"""Conditions: limits that a comparison must keep, and the grammar that they are written in.

A condition is a quantity, an operator and a limit, and may ask for certainty::

    condition := STAGE "." VARIANT "." RATE operator limit ["surely"]
    operator  := ">" | ">=" | "<" | "<="
    limit     := number "pp"        the change from the base to the new result, percentage points
               | number "%"         the rate of the new result itself, percent
    number    := ["+" | "-"] digits ["." digits]
    RATE      := ACC ERR TPR FNR TNR FPR, each also as pooled_..., IoU mIoU F1 precision
                 (of all pixels together, with or without pooled_)

A change is computed on the frames that both results evaluated, a level on all frames of the new
result. If there are several drives, both are means over drives, with equal weight for each group of
drives. A condition is only parsed, never executed.

With ``surely`` the whole interval of the change must lie beyond the limit. The interval allows for
chance in the frames, not for the training's seed, so the limit must leave room for that: two of 20
ordered pairs of five seeds on a drive of CamVid (0006R0) exceed +0.5 pp, and none exceeds it
surely; without room, seven exceed 0 surely. Only the mean change of ACC, ERR, FNR and FPR has an
interval.

A condition that cannot be judged never counts as kept. It cannot be judged if a rate is undefined,
if a change is between different scales or truths, if certainty is required and there is no
interval, or if frames are too few. There must be at least as many as an interval needs
(``evaluation.least_frames``), and for a change at least half of the frames of the shorter result;
if several drives are compared, half of the scored drives of the smaller result.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.evaluation.comparison.compare import ComparedResult, Comparison, MaskChange
from roadeval.evaluation.metrics import ALL, COMPARED, METRICS, UNTABLED
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.runtime.sentence import Sentence

OPERATORS: Final[Mapping[str, Callable[[float, float], bool]]] = {
    ">": operator.gt,
    ">=": operator.ge,
    "<": operator.lt,
    "<=": operator.le,
}
QUANTITIES: Final = (*METRICS, *(f"pooled_{name}" for name in ALL), *UNTABLED)
_GRAMMAR: Final = re.compile(
    r"\s*(?P<stage>[\w-]+)\.(?P<variant>[\w-]+)\.(?P<rate>\w+)"
    r"\s*(?P<operator>>=|<=|>|<)"
    r"\s*(?P<number>[+-]?\d+(?:\.\d+)?)\s*(?P<unit>pp|%)"
    r"(?P<surely>\s+surely)?\s*"
)


@dataclass(frozen=True)
class Condition:
    """A limit on a rate of a stage of a variant."""

    text: str
    stage: str
    variant: str
    rate: str
    operator: str
    limit: float
    """Number in percentage points if ``is_change``, else in percent."""
    is_change: bool
    surely: bool = False
    """Whether the whole interval of the change must lie beyond the limit."""

    @classmethod
    def parse(cls, text: str) -> Condition:
        """Read a condition.

        A `RoadevalError` if it does not follow the grammar, has a limit that no rate and no change
        reaches, or asks for certainty about a quantity without an interval.
        """
        match = _GRAMMAR.fullmatch(text)
        if match is None:
            raise RoadevalError(
                f"{text!r} is not a condition; write STAGE.VARIANT.RATE, one of > >= < <=, and a "
                "number with pp (change) or % (level), as 'post.filtered.ERR > +0.5pp'; a 'surely' "
                "after pp means the whole interval"
            )
        stage, variant, rate, comparator, number, unit, surely = match.groups()
        if rate not in QUANTITIES:
            remedy = f"there are {', '.join(QUANTITIES)}"
            raise RoadevalError(f"there is no rate {rate}", where=repr(text), remedy=remedy)
        least = 0 if unit == "%" else -100
        if not least <= float(number) <= 100:
            problem = f"{number} is not from {least} to 100: no {rate} is beyond"
            raise RoadevalError(problem, where=repr(text))
        if surely and unit == "%":
            raise RoadevalError(
                "'surely' asks for the interval of a change (pp), and a level (%) has none: leave "
                "out 'surely', or limit the change",
                where=repr(text),
            )
        if surely and rate not in COMPARED:
            remedy = f"'surely' goes with {', '.join(COMPARED)}"
            raise RoadevalError(f"{rate} has no interval", where=repr(text), remedy=remedy)
        limit = float(number), unit == "pp", bool(surely)
        return cls(" ".join(text.split()), stage, variant, rate, comparator, *limit)

    def judge(self, mask: MaskChange) -> Judgement:
        """Judge the condition on the change of the mask that it names."""
        before, after = mask.base.get(self.rate, math.nan), mask.new[self.rate]
        difference = mask.difference.get(self.rate) if self.is_change else None
        value, low, high = after - before if self.is_change else after, None, None
        if difference is not None:
            value, low, high = difference.mean, difference.low, difference.high
        if math.isnan(value):
            return self.not_judged(mask.result, f"the rate is undefined in {mask.result}")
        limited: float | None = value
        if self.surely:
            # The end of the interval that is closest to keeping the limit.
            limited = low if self.operator in (">", ">=") else high
        if limited is None:
            why = difference.none_because if difference else ""
            return self.not_judged(mask.result, f"{why}; replay more, or leave out 'surely'")
        holds = OPERATORS[self.operator](100 * limited, self.limit)
        return Judgement(self, mask.result, mask.drives, before, after, value, low, high, holds)

    def not_judged(self, result: str, because: str) -> Judgement:
        """Return a judgement without a verdict, with the reason."""
        why = Sentence("{}: not judged in {}, because {}", self.text, result, because)
        nan = math.nan
        return Judgement(self, result, 0, nan, nan, nan, None, None, None, why)


@dataclass(frozen=True)
class Judgement:
    """A condition that was judged on a result."""

    condition: Condition
    result: str
    """Label of the new result."""
    drives: int
    """Number of drives that it was judged on."""
    before: float
    after: float
    """The rate of the base (NaN for a level) and of the new result."""
    value: float
    """The change, or the level."""
    low: float | None
    high: float | None
    """The interval of the change; None without one."""
    holds: bool | None
    """None if it could not be judged."""
    why: str = ""
    """The reason why it could not be judged; else empty."""


def judge(
    comparison: Comparison, conditions: Sequence[Condition], settings: EvaluationSettings
) -> Iterator[Judgement]:
    """Judge each condition, in order, on every result that has the mask that it names."""
    for condition in conditions:
        name = f"{condition.stage}.{condition.variant}"
        masks = comparison.changes if condition.is_change else comparison.levels
        named = [mask for mask in masks if f"{mask.stage}.{mask.variant}" == name]
        for mask in named:
            why = _why_not_judged(condition, mask, comparison.results, settings.least_frames)
            yield condition.not_judged(mask.result, why) if why else condition.judge(mask)
        if not named:
            names = ", ".join(sorted({f"{mask.stage}.{mask.variant}" for mask in masks}))
            why = f"nothing compared is called {name}; there are {names}"
            new = ", ".join(result.label for result in comparison.results[1:])
            yield condition.not_judged(new, why)


def _why_not_judged(
    condition: Condition, mask: MaskChange, results: Sequence[ComparedResult], least: int
) -> str:
    """Return why a condition cannot be judged on a mask; empty if it can."""
    if not condition.is_change:
        if mask.frames >= least:
            return ""
        few = f"{mask.result} has {mask.frames} evaluated frames, and {least} are needed"
        return f"{few}; replay more of it"
    base, new = results[0], next(result for result in results if result.label == mask.result)
    names = f"{base.label} and {new.label}"
    if None not in (base.scale, new.scale) and base.scale != new.scale:
        return Sentence(
            "{} were replayed with {frames.scale} {} and {}; replay both at one scale, or "
            "limit in %",
            names,
            f"{base.scale:g}",
            f"{new.scale:g}",
        )
    if new.relabelled:
        return (
            f"the truth differs on {new.relabelled} frames between {names}, and the change may be "
            "the labels'; replay both with the same truth, or limit in %"
        )
    unit, common, smaller = "evaluated frames", mask.frames, min(base.frames, new.frames)
    if mask.frames >= least and min(base.scored, new.scored) > 1:
        unit, common, smaller = "drives", mask.drives, min(base.scored, new.scored)
    if mask.frames < least:
        few = f"and {least} are needed"
    elif 2 * common < smaller:
        few = f"fewer than half of the {smaller} of the smaller one"
    else:
        return ""
    same = "drives" if unit == "drives" else "range"
    return f"{names} have {common} {unit} in common, {few}; replay the same {same} into both"
