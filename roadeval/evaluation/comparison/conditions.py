"""Conditions: limits that a comparison must keep, and the small language they are written in.

A condition is a quantity, an operator and a limit, and may ask for certainty::

    condition := STAGE "." VARIANT "." RATE operator limit ["surely"]
    operator  := ">" | ">=" | "<" | "<="
    limit     := number "pp"        the change from the base to the new result, percentage points
               | number "%"         the rate of the new result itself, percent
    number    := ["+" | "-"] digits ["." digits]
    RATE      := ACC ERR TPR FNR TNR FPR, each also as pooled_..., IoU mIoU F1 precision
                 (of all pixels together, with or without pooled_)

A change is that of the frames that both results evaluated, a level that of all frames of the new
result. Of several drives both are means over drives, each group of drives alike. Nothing is ever
executed.

With ``surely`` the whole interval of the change must lie beyond the limit. The interval is in doubt
about frames, not about what the training's seed draws, so the limit must leave room for that: of 20
ordered pairs of five seeds on a drive of CamVid (0006R0) two trip +0.5 pp, and none trips it
surely; without room, at +0 pp, seven still do. Only the mean change of ACC, ERR, FNR and FPR has an
interval.

A condition that cannot be judged is never taken for one that is kept: where a rate is undefined, a
change is asked for between different scales or truths, certainty without an interval, and where
frames are too few. They must be at least as many as an interval needs
(``evaluation.least_frames``), and for a change at least half of the frames of the shorter result;
where several drives are compared, half of the scored drives of the smaller one.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.evaluation.comparison.compare import Change, ComparedResult, Comparison
from roadeval.evaluation.metrics import ALL, COMPARED, METRICS, OVERLAP
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.runtime.sentence import Sentence

OPERATORS: Final[Mapping[str, Callable[[float, float], bool]]] = {
    ">": operator.gt,
    ">=": operator.ge,
    "<": operator.lt,
    "<=": operator.le,
}
QUANTITIES: Final = (*METRICS, *(f"pooled_{name}" for name in ALL), *OVERLAP)
_GRAMMAR: Final = re.compile(
    r"\s*(?P<stage>[\w-]+)\.(?P<variant>[\w-]+)\.(?P<rate>\w+)"
    r"\s*(?P<operator>>=|<=|>|<)"
    r"\s*(?P<number>[+-]?\d+(?:\.\d+)?)\s*(?P<unit>pp|%)"
    r"(?P<surely>\s+surely)?\s*"
)


class ConditionError(RoadevalError):
    """A condition that cannot be read."""


@dataclass(frozen=True)
class Condition:
    """A limit on a rate of a stage of a variant."""

    text: str
    stage: str
    variant: str
    rate: str
    operator: str
    limit: float
    """In percentage points of change if ``is_change``, else in percent."""
    is_change: bool
    surely: bool = False
    """Whether the whole interval of the change must lie beyond the limit."""

    @classmethod
    def parse(cls, text: str) -> Condition:
        """Read a condition.

        A `ConditionError` if it does not follow the grammar, or asks for certainty that cannot be
        had.
        """
        match = _GRAMMAR.fullmatch(text)
        if match is None:
            raise ConditionError(
                f"{text!r} is no condition; write STAGE.VARIANT.RATE, one of > >= < <=, and a "
                "number with pp (change) or % (level), as 'post.filtered.ERR > +0.5pp', and after "
                "pp 'surely' where the whole interval must lie beyond it"
            )
        stage, variant, rate, sign, number, unit, surely = match.groups()
        if rate not in QUANTITIES:
            raise ConditionError(
                f"{text!r}: there is no rate {rate}; there are {', '.join(QUANTITIES)}"
            )
        if surely and unit == "%":
            raise ConditionError(
                f"{text!r}: 'surely' asks for the interval of a change (pp); a level (%) is that "
                "of the frames themselves and has none: leave out 'surely', or limit the change"
            )
        if surely and rate not in COMPARED:
            raise ConditionError(
                f"{text!r}: {rate} has no interval; 'surely' goes with {', '.join(COMPARED)}"
            )
        own, is_change = " ".join(text.split()), unit == "pp"
        return cls(own, stage, variant, rate, sign, float(number), is_change, bool(surely))

    def judge(self, mask: Change) -> Judgement:
        """Judge the condition on what was found of the mask that it names."""
        before, after = mask.base.get(self.rate, math.nan), mask.new[self.rate]
        difference = mask.difference.get(self.rate) if self.is_change else None
        value, low, high = after - before if self.is_change else after, None, None
        if difference is not None:
            value, low, high = difference.mean, difference.low, difference.high
        if math.isnan(value):
            return self.unjudged(mask.result, f"the rate is undefined in {mask.result}")
        limited: float | None = value
        if self.surely:
            # The end of the interval that is nearest to keeping the limit.
            limited = low if self.operator in (">", ">=") else high
        if limited is None:
            why = difference.none_because if difference else ""
            return self.unjudged(mask.result, f"{why}; replay more, or leave out 'surely'")
        holds = OPERATORS[self.operator](100 * limited, self.limit)
        return Judgement(self, mask.result, mask.drives, before, after, value, low, high, holds)

    def unjudged(self, result: str, because: str) -> Judgement:
        """Return that it could not be judged on a result, and why."""
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
    """How many it was judged on."""
    before: float
    after: float
    """The rate of the base, NaN for a level, and of the new result."""
    value: float
    """What was judged: the change, or the level."""
    low: float | None
    high: float | None
    """The interval of the change, None without one."""
    holds: bool | None
    """None where it could not be judged."""
    why: str = ""
    """The reason then."""


def judge(
    comparison: Comparison, conditions: Sequence[Condition], settings: EvaluationSettings
) -> Iterator[Judgement]:
    """Judge each condition, in order, on every result that it names a mask of."""
    for condition in conditions:
        name = condition.stage, condition.variant
        masks = comparison.changes if condition.is_change else comparison.levels
        named = [mask for mask in masks if (mask.stage, mask.variant) == name]
        for mask in named:
            why = _unjudged(condition, mask, comparison.results, settings.least_frames)
            yield condition.unjudged(mask.result, why) if why else condition.judge(mask)
        if not named:
            there = ", ".join(sorted({f"{mask.stage}.{mask.variant}" for mask in masks}))
            why = f"nothing compared is called {'.'.join(name)}; there are {there}"
            new = ", ".join(each.label for each in comparison.results[1:])
            yield condition.unjudged(new, why)


def _unjudged(
    condition: Condition, mask: Change, results: Sequence[ComparedResult], least: int
) -> str:
    """Return why a condition cannot be judged on a mask; empty where it can."""
    if not condition.is_change:
        if mask.frames >= least:
            return ""
        few = f"{mask.result} has {mask.frames} evaluated frames, and {least} are needed"
        return f"{few}; replay more of it"
    base, new = results[0], next(each for each in results if each.label == mask.result)
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
    if min(base.scored, new.scored) > 1:
        unit, common, smaller = "drives", mask.drives, min(base.scored, new.scored)
    if mask.frames < least:
        few = f"and {least} are needed"
    elif 2 * common < smaller:
        few = f"fewer than half of the {smaller} of the smaller one"
    else:
        return ""
    same = "drives" if unit == "drives" else "range"
    return f"{names} have {common} {unit} in common, {few}; replay the same {same} into both"
