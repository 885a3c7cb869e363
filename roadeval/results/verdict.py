"""The verdict on a result: how wrong its focus is, compared with what, and what to do next.

What happened on these frames or drives is exact and comes first. One sentence on other frames
follows; it never gives an interval of a single drive with few independent frames.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING, Any, Final, TypeVar

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.data.words import DASH, counted, defined, in_percent, listing, number, percent
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.score.scoreboard import Effect
from roadeval.evaluation.score.unlabelled import sign_of
from roadeval.evaluation.stats.difference import LEAST_GROUPS, Difference
from roadeval.evaluation.tables import final_stages, only, scene_ns, values_of, worst
from roadeval.results.facts import EstimateFacts, Facts, FleetFacts, UnlabelledFacts, focus_of
from roadeval.results.sentences import FINE, ROUNDING, Rates, is_sure
from roadeval.runtime.sentence import Sentence

if TYPE_CHECKING:
    import pandas as pd

BLIND: Final = f"{BASELINE}, which ignores the image"
FEW: Final = 5
"""Number of independent frames; with fewer, one drive says little about other frames."""
WORDS: Final = 60
"""Greatest number of words of a verdict; a longer verdict does not explain the baseline."""
WEAK: Final = 0.02
"""Least error rate at which the preset ``robust`` is worth a try."""
ROBUST: Final = "robust"
LOOKED_AT: Final = 10
"""Greatest number of frames without truth that are worth a look."""
NAMED: Final = 5
"""Greatest number of frames without truth that a verdict names."""


def verdict_on(facts: Facts | FleetFacts) -> str:
    """Return the verdict on a drive or a fleet, after the sentences on what does not fit."""
    arguments: dict[str, Any] = {"focus": facts.focus}
    if isinstance(facts, Facts) and not facts.cameras:
        arguments |= {"thresholds": facts.thresholds}
        arguments |= {"unlabelled": facts.unlabelled, "estimated": facts.estimate}
    sentence = verdict(facts.totals, facts.effects, **arguments)
    return Sentence(" ").join([*facts.misfits, sentence])


AnyFacts = TypeVar("AnyFacts", bound=Facts | FleetFacts)


def with_focus(facts: AnyFacts, focus: str, doubts: pd.DataFrame | None = None) -> AnyFacts:
    """Return facts with another focus and the verdict on it, without a new replay.

    ``doubts`` are the rows of ``unlabelled``. The facts of a rig's cameras stay as they are.
    """
    output = {**facts.run.get("output", {}), "focus": focus}
    changes: dict[str, Any] = {"run": {**facts.run, "output": output}}
    unlabelled = facts.unlabelled if isinstance(facts, Facts) else None
    if unlabelled and doubts is not None and len(rows := only(doubts, variant=focus)):
        changes["unlabelled"] = describe_doubts(rows, unlabelled.differing)
    facts = replace(facts, **changes)
    return replace(facts, verdict=verdict_on(facts))


def verdicts(facts: Facts | FleetFacts, doubts: pd.DataFrame | None = None) -> dict[str, str]:
    """Return the verdict with each variant as the focus; for ``doubts`` see `with_focus`."""
    names = [*facts.finals] or ([] if doubts is None else values_of(doubts, "variant"))
    return {name: with_focus(facts, name, doubts).verdict for name in names if name != BASELINE}


def describe_doubts(
    rows: pd.DataFrame, differing: Mapping[str, Mapping[str, float]]
) -> UnlabelledFacts | None:
    """Return which frames without truth to look at; None if there are no such frames.

    ``rows`` are the rows of ``unlabelled`` of one variant; for ``differing`` see `UnlabelledFacts`.
    """
    if not len(rows):
        return None
    look_at, sign = [], sign_of(rows)
    if sign is not None:
        ranked = worst(rows, LOOKED_AT, sign, scene_ns(rows["stamp_ns"]))
        look_at = ranked["frame"].tolist()
    shares = {name: {**others} for name, others in differing.items()}
    return UnlabelledFacts(len(rows), str(rows["variant"].iloc[0]), sign, look_at, shares)


def verdict(
    totals: Mapping[str, Rates],
    effects: Sequence[Effect],
    thresholds: Mapping[str, Mapping[str, Any]] | None = None,
    *,
    focus: str | None = None,
    unlabelled: UnlabelledFacts | None = None,
    estimated: EstimateFacts | None = None,
) -> str:
    """Return the verdict on a drive or a fleet, a few sentences about its focus.

    `focus_of` chooses the default focus. The verdict says how wrong the focus is, and in which way;
    how it compares with the baseline and with the same method without the filter; which other
    variant is best, if there is one; and what to do next. ``totals`` are rates by variant and
    stage, empty if nothing was scored; ``effects`` include the differences of final masks;
    ``thresholds`` are the best ones, as in `roadeval.results.facts.Facts`. If nothing was scored,
    ``unlabelled`` tells which frames to look at. ``estimated`` are rates of the whole drive, from
    frames drawn at random.
    """
    if not totals:
        nothing = "Nothing to score: no frame with truth was evaluated."
        return " ".join([nothing, *without_truth(unlabelled)])
    stages = final_stages((variant, stage) for variant, masks in totals.items() for stage in masks)
    rates = {variant: totals[variant][stage] for variant, stage in stages.items()}
    best = lowest({name: mask for name, mask in rates.items() if name != BASELINE})
    focus = focus_of(rates, focus)
    if best is None or focus is None:
        return f"Nothing to compare: {TESTED} is undefined on every frame."
    of_focus = {e.base: e.rates[TESTED] for e in effects if e.final and e.variant == focus}
    error = rates[focus][TESTED]
    whole_drive = [*from_labels(estimated, focus)]
    lead = "On these alone: " if whole_drive else ""
    least = percent(rates[best][TESTED], 1)
    is_other = not defined(error) or (rates[best][TESTED] < error and least != percent(error, 1))
    text = " ".join(
        [
            *whole_drive,
            f"{lead}{_how_wrong(focus, rates[focus], [*of_focus.values()])}",
            *_compared(focus, of_focus),
            *([f"Best here is {best}: {least} %."] if is_other else []),
            *_next_step(focus, rates, thresholds or {}),
        ]
    )
    return text if len(text.split()) <= WORDS else text.replace(BLIND, BASELINE)


def _how_wrong(name: str, rates: Rates, differences: Sequence[Difference]) -> str:
    """Return how many pixels a final mask has wrong, and which ones."""
    if not defined(rates[TESTED]):
        return f"{name}: {TESTED} is undefined on every frame."
    sample = counted(rates["frames"], "frame")
    if rates.get("drives", 1) > 1:
        sample = counted(rates["drives"], "drive")
        if groups := {change.groups or rates["drives"] for change in differences} - {
            rates["drives"]
        }:
            sample += f" in {counted(min(groups), 'group')}"
    errors = f" It {kinds}." if (kinds := describe_errors(rates)) else ""
    return f"{name}: {percent(rates[TESTED], 1)} % of the pixels are wrong ({sample}).{errors}"


def describe_errors(rates: Rates) -> str:
    """Return how much road is missed, and what is taken for road; empty if both are undefined.

    >>> describe_errors({"FNR": 0.32, "FPR": 0.0004})
    'misses 32.0 % of the road and takes almost nothing else for road'
    """
    kinds = []
    if defined(missed := rates["FNR"]):
        share = f"{percent(missed, 1)} %" if missed >= ROUNDING else "almost nothing"
        kinds.append(f"misses {share} of the road")
    if defined(added := rates["FPR"]):
        share = f"{percent(added, 1)} % of the rest" if added >= ROUNDING else "almost nothing else"
        kinds.append(f"takes {share} for road")
    return " and ".join(kinds)


def _compared(focus: str, differences: Mapping[str, Difference]) -> Iterator[str]:
    """Yield how the focus compares with the baseline and without the filter, here and on others."""
    names = {BASELINE: BLIND} | ({UNFILTERED: "without the filter"} if focus == FILTERED else {})
    pairs = [
        (differences[base], name)
        for base, name in names.items()
        if base in differences and differences[base].units
    ]
    doubt = next((_no_interval(change) for change, _ in pairs if not change.is_zero), "")
    points = [_points(change, name, alone=bool(doubt)) for change, name in pairs]
    if points:
        yield f"That is {', and '.join(points)}."
    if BASELINE not in differences:
        yield "There is no baseline: no labelled frame was used for training."
    if doubt:
        yield doubt


def _no_interval(change: Difference) -> str:
    """Return why a difference says nothing of other frames or drives; empty if it does."""
    if change.low is None:
        return f"{change.none_because[0].upper()}{change.none_because[1:]}."
    if change.unit == "frames" and change.effective is not None and change.effective < FEW:
        return f"One drive says little about others: {LEAST_GROUPS} would tell."
    return ""


def _points(change: Difference, name: str, *, alone: bool = False) -> str:
    """Return a difference of error rates in points, with its interval unless ``alone``.

    >>> _points(Difference(-0.02, -0.05, 0.01, 0.2, 0.95, "frames", 91), "blind")
    '2.0 points (may be chance) better than blind'
    """
    if change.is_zero:
        return f"exactly as good as {name}"
    doubt = ""
    if not alone and change.low is not None:
        doubt = (
            f" ({DASH.join(_ends(change))} on other {change.unit})"
            if is_sure(change)
            else " (may be chance)"
        )
    direction = "worse" if change.mean > 0 else "better"
    return f"{_size(change.mean, change)} points{doubt} {direction} than {name}"


def describe_change(change: Difference, new: str, base: str, ends: tuple[Rates, Rates]) -> str:
    """Return how a new mask compares with a base, here and on other frames or drives.

    ``ends`` are the rates of the base and of the new mask. The text names them if their difference
    is ``change``, because then they are of the same frames or drives.

    >>> change = Difference(-0.02, -0.03, -0.01, 0.001, 0.95, "frames", 9)
    >>> print(describe_change(change, "new", "old", ({}, {})))
    new is better than old: by 2.0 points (9 frames). On other frames by 1.0 to 3.0 points.
    """
    if not change.units:
        return f"Nothing to compare: {TESTED} is undefined on every {change.unit[:-1]}."
    sample = counted(change.units, change.unit[:-1])
    if change.groups not in (None, change.units):
        sample += f" in {counted(change.groups or 0, 'group')}"
    if change.is_zero:
        return f"{new} is exactly as good as {base} ({sample})."
    if change.better is not None:
        sample += f", better on {change.better}, worse on {change.worse}"
    before, after = (rates.get(TESTED) for rates in ends)
    size = f"by {_size(change.mean, change)} points"
    if defined(before) and defined(after) and abs(after - before - change.mean) < ROUNDING:
        size = f"{_size(after, change)} % wrong instead of {_size(before, change)} %"
    direction, doubt = "worse" if change.mean > 0 else "better", _no_interval(change)
    if not doubt and is_sure(change):
        doubt = f"On other {change.unit} by {' to '.join(_ends(change))} points."
    elif not doubt:
        family = ""
        if is_sure(replace(change, p_holm=None)):
            family = f", as {change.comparisons} masks are compared"
        doubt = f"This may be chance{family}."
    return f"{new} is {direction} than {base}: {size} ({sample}). {doubt}"


def _ends(change: Difference) -> list[str]:
    """Return the ends of a difference's interval in percent; the end nearer to 0 comes first."""
    ends = sorted((change.low or 0.0, change.high or 0.0), key=abs)
    return [_size(end, change) for end in ends]


def _size(fraction: float, change: Difference) -> str:
    """Return the size of a fraction in percent, with two digits beside a fine difference."""
    return f"{abs(in_percent(fraction)):.{1 if abs(change.mean) >= FINE else 2}f}"


def _next_step(
    focus: str, rates: Mapping[str, Rates], thresholds: Mapping[str, Mapping[str, Any]]
) -> Iterator[str]:
    """Yield what to do next: set the threshold, or try the preset that is best on real roads.

    A threshold is not named if it hardly lowers the error, or if no pixel is road above it.
    """
    error, pooled = rates[focus][TESTED], rates[focus].get(f"pooled_{TESTED}")
    best = thresholds.get(focus)
    if best and best["threshold"] < 1 and defined(pooled) and pooled - best[TESTED] >= ROUNDING:
        digits = 1 if pooled - best[TESTED] >= FINE else 2
        lines = best.get("lines") or f"threshold = {best['threshold']:.2g}"
        setting = "`, `".join(lines.splitlines())
        yield f"Set `{setting}`: then {in_percent(best[TESTED]):.{digits}f} % are wrong."
    elif {*rates} <= {FILTERED, UNFILTERED, BASELINE} and defined(error) and error >= WEAK:
        yield "Next: try --variant robust."


def lowest(rates: Mapping[str, Rates]) -> str | None:
    """Return the variant with the lowest error rate, among the variants with masks of all frames.

    ``rates`` are the rates of final masks by variant, with their number of ``frames``. None if no
    error rate is defined.
    """
    most = max((mask.get("frames", 0) for mask in rates.values()), default=0)
    full = {
        name: mask[TESTED]
        for name, mask in rates.items()
        if mask.get("frames", 0) == most and defined(mask[TESTED])
    }
    return min(full, key=full.__getitem__, default=None)


RANKED_BY: Final = {
    "entropy": "{variant} is least sure where road is (entropy of its probability)",
    "disagreement": "{variant} and the other variants differ most",
    "flicker": "the mask of {variant} changes most from the frame before",
}
"""The reason why a frame without truth comes first, by the sign of doubt that ranks it."""


def without_truth(unlabelled: UnlabelledFacts | None) -> Iterator[str]:
    """Yield what is known without truth: a bound on the greater of two error rates, and a rank."""
    if unlabelled is None:
        return
    pairs = [
        (share, one, other)
        for one, shares in unlabelled.differing.items()
        for other, share in shares.items()
    ]
    if pairs:
        share, one, other = max(pairs, key=itemgetter(0))
        yield (
            f"{one} and {other} differ on {percent(share, 1)} % of the pixels, so one of the two "
            f"is wrong on at least {math.floor(share * 500) / 10:.1f} %."
        )
    if unlabelled.look_at and unlabelled.sign:
        why = RANKED_BY[unlabelled.sign].format(variant=unlabelled.variant)
        frames = listing([str(frame) for frame in unlabelled.look_at[:NAMED]])
        yield f"Look first at frames {frames}: there {why}. That is a rank, and no error rate."


def from_labels(estimated: EstimateFacts | None, variant: str) -> Iterator[str]:
    """Yield a variant's error rate on the whole drive, from its labelled frames, in a sentence."""
    rate = estimated.rates.get(variant, {}).get(TESTED) if estimated else None
    if estimated is None or rate is None:
        return
    ends = "no interval yet"
    if rate.low is not None and rate.high is not None:
        ends = f"{percent(rate.low, 1)} to {percent(rate.high, 1)}"
    more = ""
    if rate.to_halve:
        more = f"; {number(rate.to_halve)} more drawn at random would halve that interval"
    yield (
        f"{variant}: {TESTED} {percent(rate.mean, 1)} % ({ends}) from {number(rate.labels)} "
        f"labelled frames, drawn at random, of {number(rate.frames)}{more}. Errors on up to "
        f"{percent(rate.missed, 0)} % of the frames may be missed by so few."
    )
    if rate.unseen:
        yield (
            f"{number(rate.unseen)} frames are far more in doubt than any that was drawn: the "
            "upper end counts all their pixels as wrong. More labels, drawn at random, would tell."
        )
    worst = sorted((-(e.get(variant) or 0.0), frame) for frame, e in estimated.apart.items())
    if shown := [f"{frame} ({percent(-error, 1)} %)" for error, frame in worst[:NAMED]]:
        yield f"Frames that were picked by rank are not in it; the worst: {listing(shown)}."
