"""Limits that a comparison must keep: the small language of ``--fail-if``.

A condition is a quantity, an operator and a limit::

    condition := STAGE "." VARIANT "." RATE operator limit
    operator  := ">" | ">=" | "<" | "<="
    limit     := number "pp"        the change from the base to the new result, percentage points
               | number "%"         the rate of the new result itself, percent
    number    := ["+" | "-"] digits ["." digits]
    RATE      := ACC ERR TPR FNR TNR FPR, each also as pooled_..., IoU F1 precision

``post.filtered.ERR > +0.5pp`` holds where the error rate of the final mask has risen by more than
half a percentage point; ``post.filtered.ERR > 20%`` where it is above a fifth. A change is that of
the frames that both results evaluated; a level is that of all the frames of the new result, and
needs no base: between different drives it is judged on every result. Nothing is ever executed.

A condition that cannot be judged is an error, and never taken for one that is kept: where a rate
is undefined, where a change is asked for between different drives or scales, and where too few
frames tell. They must be at least as many as an interval needs (``evaluation.effective_frames``,
10 by default), and for a change at least half of the frames of the shorter result.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from roadeval.errors import RoadevalError
from roadeval.evaluation.metrics import METRICS, OVERLAP
from roadeval.evaluation.settings import EvaluationSettings

OPERATORS: Final[Mapping[str, Callable[[float, float], bool]]] = {
    ">": operator.gt,
    ">=": operator.ge,
    "<": operator.lt,
    "<=": operator.le,
}
QUANTITIES: Final = (*METRICS, *(f"pooled_{name}" for name in METRICS), *OVERLAP)
_GRAMMAR: Final = re.compile(
    r"\s*(?P<stage>[\w-]+)\.(?P<variant>[\w-]+)\.(?P<rate>\w+)"
    r"\s*(?P<operator>>=|<=|>|<)"
    r"\s*(?P<number>[+-]?\d+(?:\.\d+)?)\s*(?P<unit>pp|%)\s*"
)


class ConditionError(RoadevalError):
    """A condition that cannot be read, or not be judged."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A limit on a rate of a stage of a variant.

    ``limit`` is in percentage points of change if ``is_change``, else in percent.
    """

    text: str
    stage: str
    variant: str
    rate: str
    operator: str
    limit: float
    is_change: bool

    @classmethod
    def parse(cls, text: str) -> Condition:
        """Read a condition.

        Raises
        ------
        ConditionError
            If it does not follow the grammar.
        """
        match = _GRAMMAR.fullmatch(text)
        if match is None:
            raise ConditionError(
                f"{text!r} is no condition; write STAGE.VARIANT.RATE, one of > >= < <=, and a "
                "number with pp (change) or % (level), as 'post.filtered.ERR > +0.5pp'"
            )
        if match["rate"] not in QUANTITIES:
            raise ConditionError(
                f"{text!r}: there is no rate {match['rate']}; there are {', '.join(QUANTITIES)}"
            )
        return cls(
            " ".join(text.split()),
            match["stage"],
            match["variant"],
            match["rate"],
            match["operator"],
            float(match["number"]),
            match["unit"] == "pp",
        )

    def judge(self, change: Mapping[str, Any]) -> tuple[bool, str]:
        """Say whether it holds, and why in a sentence.

        Parameters
        ----------
        change
            A row of a comparison's ``changes``: ``result``, ``base`` and ``new`` rates.

        Raises
        ------
        ConditionError
            If the rate is undefined there.
        """
        before, after = change["base"].get(self.rate), change["new"][self.rate]
        wanted = (before, after) if self.is_change else (after,)
        if any(value is None or math.isnan(value) for value in wanted):
            raise ConditionError(f"{self.text}: undefined in {change['result']}, so not judged")
        what = f"{self.stage}.{self.variant}.{self.rate} of {change['result']}"
        value = 100 * (after - before if self.is_change else after)
        holds = OPERATORS[self.operator](value, self.limit)
        if self.is_change:
            told = f"changed by {value:+.2f} pp ({100 * before:.2f} % to {100 * after:.2f} %)"
        else:
            told = f"is {value:.2f} %"
        return holds, f"{what} {told}: {self.text} {'holds' if holds else 'does not hold'}"


def judge(
    comparison: Mapping[str, Any],
    conditions: Sequence[Condition],
    settings: EvaluationSettings,
) -> list[dict[str, Any]]:
    """Judge conditions on every new result; a row for each: ``text``, ``holds``, ``sentence``.

    Parameters
    ----------
    comparison
        See `roadeval.evaluation.comparison.compare`.
    conditions
        Each is judged on every result that it names a mask of.
    settings
        How many frames it takes.

    Raises
    ------
    ConditionError
        If a condition asks for what is not there, or for a change between different drives or
        scales, or if too few frames tell.
    """
    rows = []
    for condition in conditions:
        if condition.is_change and not comparison["same_drive"]:
            raise ConditionError(
                f"{condition.text}: not judged, because the results are of different drives, whose "
                "difference mixes the scene with the method; limits in % can be judged"
            )
        for row in _matching(condition, comparison["changes" if condition.is_change else "levels"]):
            _must_tell(condition, row, comparison["results"], settings.effective_frames)
            holds, sentence = condition.judge(row)
            rows.append({"text": condition.text, "holds": holds, "sentence": sentence})
    return rows


def _matching(
    condition: Condition, compared: Sequence[Mapping[str, Any]]
) -> list[Mapping[str, Any]]:
    """Give the rows of the mask that a condition names."""
    named = (condition.stage, condition.variant)
    matching = [row for row in compared if (row["stage"], row["variant"]) == named]
    if not matching:
        there = {f"{row['stage']}.{row['variant']}" for row in compared}
        raise ConditionError(
            f"{condition.text}: nothing compared is called {'.'.join(named)}; there are "
            f"{', '.join(sorted(there))}"
        )
    return matching


def _must_tell(
    condition: Condition,
    row: Mapping[str, Any],
    results: Sequence[Mapping[str, Any]],
    least: int,
) -> None:
    """Refuse to judge by a handful of frames, or a change of what hardly has anything in common."""
    label, count = row["result"], row["frames"]
    why = ""
    if condition.is_change:
        new = next(each for each in results if each["label"] == label)
        why = _no_change_tells(results[0], new, count, least)
    elif count < least:
        why = f"{label} has {count} evaluated frames, and {least} are needed; replay more of it"
    if why:
        raise ConditionError(f"{condition.text}: not judged, because {why}")


def _no_change_tells(
    base: Mapping[str, Any], new: Mapping[str, Any], common: int, least: int
) -> str:
    """Say why a change between two results of a drive tells nothing; empty if it does."""
    names = f"{base['label']} and {new['label']}"
    scales = base["scale"], new["scale"]
    if None not in scales and scales[0] != scales[1]:
        return (
            f"{names} were replayed at --scale {scales[0]:g} and {scales[1]:g}; replay both at one "
            "scale, or limit in %"
        )
    shorter = min(base["frames"], new["frames"])
    if common < least:
        why = f"and {least} are needed"
    elif 2 * common < shorter:
        why = f"fewer than half of the {shorter} of the shorter one"
    else:
        return ""
    return (
        f"{names} have {common} evaluated frames in common, {why}; replay both over the same range"
    )
