"""A result in words: differences, the verdict, notes on frames, and the paper's claims."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import Any, Final

from roadeval.data import BASELINE, FILTERED, TUNED, UNFILTERED, Tally
from roadeval.data.words import counted, defined, in_percent, interval, listing, number, percent
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.score.fit import TRUTH, Finding, Misfit
from roadeval.evaluation.score.scoreboard import Effect
from roadeval.evaluation.settings import FAILED_ERR, FAILED_FNR, NOTEWORTHY
from roadeval.evaluation.stats.difference import Difference
from roadeval.evaluation.tables import FILTER, final_stages
from roadeval.results.facts import EstimateFacts, FrameAccount, UnlabelledFacts

FINE: Final = 0.005
"""Levels that differ by less have two digits."""
ROUNDING: Final = 5e-4
"""If the difference of two levels is farther from the paired one, they are of other frames."""
MARK: Final = "*"
"""Marks a difference that is significant after correction for all that are shown together."""
NOTHING_SCORED: Final = "Nothing to score: no frame with truth was evaluated."
OVERCONFIDENT: Final = 0.01
"""Least difference between errors and stated errors that `describe_overconfidence` reports."""
NAMED: Final = 5
"""Frames without truth that a verdict names."""
_OF_FILTER: Final = "The filter "
"""Beginning of the note on the filter's effect on a frame."""
BLIND: Final = f"{BASELINE}, which never looks at the image"


Rates = Mapping[str, Any]
"""Rates of a mask by their names."""


def sentence(
    difference: Difference,
    what: str,
    rate: str,
    ends: tuple[Rates, Rates] | None = None,
    *,
    windows: str = "",
    said_before: str = "",
) -> str:
    """Return what a difference means for these frames or drives, and then for others like them.

    The difference is with ``what`` minus without it, as ``the filter`` or ``net instead of blind``;
    ``rate`` is what changes, as ``ERR of post``. ``ends`` are the rates without and with it, which
    are named if they are of the same frames or drives; ``windows`` tells in brackets in how many it
    is lower; ``said_before`` is the clause on others that a sentence before has.

    >>> difference = Difference(-0.02, -0.03, -0.01, 0.001, 0.95, "frames", 91)
    >>> sentence(difference, "the filter", "ERR")
    'On these 91 frames the filter lowers ERR by 2.0 pp; on frames like these by 1.0 to 3.0 pp.'
    """
    unit = difference.unit[:-1]
    if not difference.units:
        return f"Nothing to compare: {rate} is undefined on every {unit}."
    here = _here(difference)
    if difference.is_zero:
        return f"{here} {what} leaves {rate} of every {unit} as it is."
    by = f"by {_size(difference.mean, _digits(difference))} pp"
    before, after = (rates.get(TESTED) for rates in ends or ({}, {}))
    if defined(before) and defined(after) and abs(after - before - difference.mean) < ROUNDING:
        digits = 1 if abs(difference.mean) >= FINE else 2
        by = f"from {_size(before, digits)} to {_size(after, digits)} %"
    doubt = "" if _doubt(difference) == said_before else f"; {_doubt(difference)}"
    verb = "raises" if difference.mean > 0 else "lowers"
    return f"{here} {what} {verb} {rate} {by}{windows or _count_directions(difference)}{doubt}."


def _doubt(difference: Difference) -> str:
    """Return what a difference means for other frames or drives, as a clause."""
    if difference.low is None or difference.high is None:
        return difference.none_because
    like, digits = f"on {difference.unit} like these", _digits(difference)
    if is_sure(difference):
        least, most = sorted((abs(difference.low), abs(difference.high)))
        return f"{like} by {_size(least, digits)} to {_size(most, digits)} pp"
    family = ""
    if is_sure(replace(difference, p_holm=None)):
        family = f" (corrected for {difference.comparisons} comparisons)"
    return f"{like} the effect is unclear: {_ends(difference.low, difference.high, digits)}{family}"


def _ends(low: float, high: float, digits: int) -> str:
    """Return an interval in words.

    >>> _ends(-0.03, 0.01, 1), _ends(-0.03, -0.01, 1)
    ('from 3.0 pp lower to 1.0 pp higher', 'from 1.0 to 3.0 pp lower')
    """
    if low < 0 < high:
        return f"from {_size(low, digits)} pp lower to {_size(high, digits)} pp higher"
    least, most = sorted((low, high), key=abs)
    word = "lower" if high <= 0 else "higher"
    return f"from {_size(least, digits)} to {_size(most, digits)} pp {word}"


def _digits(difference: Difference) -> int:
    most = max(abs(difference.mean), -(difference.low or 0.0), difference.high or 0.0)
    return 1 if most >= 0.01 else 2


def _size(fraction: float, digits: int) -> str:
    return f"{abs(in_percent(fraction)):.{digits}f}"


def _here(difference: Difference) -> str:
    units, groups = difference.units, difference.groups
    if difference.unit == "frames":
        return "On this frame" if units == 1 else f"On these {units} frames"
    in_groups = "" if groups in (None, units) else f" in {counted(groups or 0, 'group')}"
    return f"Over {counted(units, 'drive')}{in_groups}"


def _count_directions(difference: Difference) -> str:
    if difference.worse is None:
        return ""
    if difference.unit == "frames":
        return f" (better on {difference.better} of {difference.units})"
    return f" (worse on {difference.worse}, better on {difference.better})"


_WHY: Final = {
    "trained on": "to train on",
    "equal to a training frame": "equal to one of them",
    "unlabelled": "without truth",
    "picked": "labelled because they were in doubt",
    "undecodable": "that cannot be decoded",
    "failed in a stage": "on which a stage failed",
    "gap after training": "in the gap after training",
    "gap beside training": "in the gap beside training",
}
"""Words behind a number of frames, by the reasons of `roadeval.results.facts.FrameAccount`."""


def account(frames: FrameAccount, windows: int | None = None) -> str:
    """Return how many frames of a log were evaluated, and why the others were not.

    >>> account(FrameAccount(in_log=100, evaluated=90, skipped={"trained on": 10}), 9)
    '90 of 100 frames were evaluated, in 9 windows. Left out: 10 to train on.'
    """
    total = frames.evaluated if frames.in_log is None else frames.in_log
    of = "" if frames.evaluated == total else f"{number(frames.evaluated)} of "
    verb = "was" if frames.evaluated == 1 else "were"
    within = f", in {counted(windows, 'window')}" if windows else ""
    sentence_on_frames = f"{of}{counted(total, 'frame')} {verb} evaluated{within}."
    why = [f"{number(count)} {_WHY.get(name, name)}" for name, count in frames.skipped.items()]
    return f"{sentence_on_frames} Left out: {', '.join(why)}." if why else sentence_on_frames


def is_sure(difference: Difference) -> bool:
    """Return whether a difference is sure, by its corrected p-value if it has one."""
    p = difference.p if difference.p_holm is None else difference.p_holm
    return p is not None and p < 1 - difference.confidence


def is_significant(difference: Difference) -> bool:
    """Return whether a difference is sure after Holm's correction."""
    return difference.p_holm is not None and is_sure(difference)


def marked_interval(difference: Difference) -> str:
    """Return the interval of a difference, with a mark if it excludes 0 after correction."""
    mark = f" {MARK}" if is_significant(difference) else ""
    return interval(difference.low, difference.high) + mark


def correction(differences: Iterable[Difference]) -> str:
    """Return what a mark on differences of ERR means; empty if none has one."""
    marked = list(differences)
    counts = sorted({shown.comparisons for shown in marked if shown.comparisons})
    if not any(map(is_significant, marked)):
        return ""
    if counts == [1]:
        return f"{MARK} excludes 0; it is the only one, so nothing is corrected."
    many = f"{counts[0]} differences" if len(counts) == 1 else "differences"
    families = "" if len(counts) == 1 else f" against one base ({' and '.join(map(str, counts))})"
    return (
        f"{MARK} significant after Holm's correction for the {many} of ERR of final "
        f"masks{families}; others are not corrected."
    )


def misfit(finding: Finding, period_ms: float | None, remedy: str) -> str:
    """Return two sentences: what does not fit, and what to do.

    ``period_ms`` is the time from one frame to the next, if it is known.

    >>> misfit(Finding("truth", Misfit.LAG, frames=3), 100, "Set `truth.first` to 3.")
    'The truth is 3 frames (300 ms) late: it fits earlier images better. Set `truth.first` to 3.'
    """
    subject, verb = ("The truth", "is") if finding.subject == TRUTH else (None, "are")
    subject = subject or f"The masks of {finding.subject}"
    match finding.misfit:
        case Misfit.LAG:
            size = abs(finding.frames)
            time = f" ({size * period_ms:.0f} ms)" if period_ms else ""
            word, which = ("late", "earlier") if finding.frames > 0 else ("early", "later")
            what = f"{counted(size, 'frame')}{time} {word}: {_it(verb)} {which} images better"
        case Misfit.MIRRORED:
            what = f"mirrored: with left and right exchanged {_it(verb)} the images better"
        case Misfit.UPSIDE_DOWN:
            what = f"upside down: turned over {_it(verb)} the images better"
        case Misfit.INVERTED:
            what = (
                "inverted, or of another class: road is high in the image, not before the vehicle"
            )
        case _:
            ways = ((finding.right, "right", "left"), (finding.down, "down", "up"))
            parts = [f"{abs(n)} pixels {more if n > 0 else less}" for n, more, less in ways if n]
            what = f"moved by {' and '.join(parts)}: moved back {_it(verb)} images and truth better"
    return f"{subject} {verb} {what}. {remedy}"


def _it(verb: str) -> str:
    return "it fits" if verb == "is" else "they fit"


def verdict(
    totals: Mapping[str, Rates],
    effects: Sequence[Effect],
    claims: Mapping[str, Mapping[str, int]] | None = None,
    thresholds: Mapping[str, Mapping[str, Any]] | None = None,
    *,
    unlabelled: UnlabelledFacts | None = None,
    estimated: EstimateFacts | None = None,
) -> str:
    """Return the verdict on a drive or a fleet, a few sentences.

    It tells which variant is best, and whether it beats the baseline; the rate of each method at
    another threshold; the effects of tuning and of the filter; and which step adds most to the
    filtered variant's errors.
    ``totals`` are by variant and stage, empty if nothing was scored; ``effects`` are of final masks
    at least; ``claims`` tells in how many windows of a drive each claim of the paper holds, and
    ``thresholds`` the rates at other thresholds, see `at_thresholds`. If nothing was scored,
    ``unlabelled`` tells which frames to look at. ``estimated`` are the rates of the whole drive
    from frames that were drawn at random.
    """
    if not totals:
        return " ".join([NOTHING_SCORED, *without_truth(unlabelled)])
    stages = final_stages((variant, stage) for variant in totals for stage in totals[variant])
    rates = {variant: totals[variant][stage] for variant, stage in stages.items()}
    finals = {(effect.base, effect.variant): effect for effect in effects if effect.final}
    best = lowest({name: final for name, final in rates.items() if name != BASELINE})
    if best is None:
        return f"Nothing to compare: {TESTED} is undefined on every frame."
    against = finals.get((BASELINE, best))
    blind = None if against is None else against.rates[TESTED]
    parts = [_best(best, rates, blind)]
    if of_drive := [*from_labels(estimated, best)]:
        parts = [*of_drive, f"On these alone: {parts[0]}"]
    parts += at_thresholds(thresholds or {}, rates)
    for base, variant in (pair for pair in finals if pair[1] == pair[0] + TUNED):
        change, ends = finals[base, variant].rates[TESTED], (rates[base], rates[variant])
        parts.append(sentence(change, f"tuning {base}", f"{TESTED} of {stages[variant]}", ends))
    of_filter = finals.get((UNFILTERED, FILTERED))
    if of_filter is not None and of_filter.rates[TESTED].units:
        parts.append(
            sentence(
                *(of_filter.rates[TESTED], "the filter", f"{TESTED} of {of_filter.stage}"),
                (rates[UNFILTERED], rates[FILTERED]),
                windows=_in_windows(claims),
                said_before=_doubt(blind) if blind else "",
            )
        )
    return " ".join(filter(None, [*parts, _costs_most(totals)]))


RANKED_BY: Final = {
    "entropy": "{variant} is least sure where road is (entropy of its probability)",
    "disagreement": "{variant} and the other variants differ most",
    "flicker": "the mask of {variant} changes most from the frame before",
}
"""Reasons why frames without truth come first, by the sign that ranks them."""


def without_truth(unlabelled: UnlabelledFacts | None) -> Iterator[str]:
    """Yield what is known without truth: a bound on the greater of two error rates, and a rank."""
    if unlabelled is None:
        return
    pairs = [
        (share, one, other)
        for one, others in unlabelled.differing.items()
        for other, share in others.items()
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
    estimate = estimated.rates.get(variant, {}).get(TESTED) if estimated else None
    if estimated is None or estimate is None:
        return
    ends = "no interval yet"
    if estimate.low is not None and estimate.high is not None:
        ends = f"{percent(estimate.low, 1)} to {percent(estimate.high, 1)}"
    more = ""
    if estimate.to_halve:
        more = f"; {number(estimate.to_halve)} more drawn at random would halve that interval"
    yield (
        f"{variant}: {TESTED} {percent(estimate.mean, 1)} % ({ends}) from "
        f"{number(estimate.labels)} labelled frames, drawn at random, of "
        f"{number(estimate.frames)}{more}. Errors on up to {percent(estimate.missed, 0)} % of the "
        "frames may be missed by so few."
    )
    if estimate.unseen:
        yield (
            f"{number(estimate.unseen)} frames are far more in doubt than any that was drawn: the "
            "upper end takes them for wrong altogether. More labels, drawn at random, would tell."
        )
    worst = sorted(
        (-(rates.get(variant) or 0.0), frame) for frame, rates in estimated.apart.items()
    )
    if shown := [f"{frame} ({percent(-error, 1)} %)" for error, frame in worst[:NAMED]]:
        yield f"Frames that were picked by rank are not in it; the worst: {listing(shown)}."


def at_thresholds(
    thresholds: Mapping[str, Mapping[str, Any]], rates: Mapping[str, Rates]
) -> Iterator[str]:
    """Yield a sentence on each method's ERR at the threshold that is best on the training frames.

    Parameters
    ----------
    thresholds
        As in `roadeval.results.facts.Facts`.
    rates
        Rates of final masks by variant. A method whose ERR would hardly change is left out.
    """
    for name, best in thresholds.items():
        now = rates.get(name, {}).get(f"pooled_{TESTED}", math.nan)
        if abs(now - best[TESTED]) >= ROUNDING:
            digits = 1 if abs(now - best[TESTED]) >= FINE else 2
            lines = "` and `".join(best.get("lines", "").splitlines())
            yield (
                f"{name} at {best['threshold']:.2g} instead of {best['own']:.2g}, which the "
                f"training frames choose: {in_percent(best[TESTED]):.{digits}f} instead of "
                f"{in_percent(now):.{digits}f} %{f' (write `{lines}`)' if lines else ''}."
            )


def describe_overconfidence(curves: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Iterator[str]:
    """Yield a sentence on each variant that errs at least twice as often as its probabilities say.

    ``curves`` are as in `roadeval.results.facts.Facts`. Less than a point of difference is ignored.
    """
    for variant, stages in curves.items():
        *_, last = stages.values()
        stated, wrong = (1 - last.get(name, math.nan) for name in ("confidence", "right"))
        if wrong >= max(2 * stated, stated + OVERCONFIDENT):
            yield (
                f"{variant} is over-confident: by its probabilities {percent(stated, 1)} % of the "
                f"pixels are wrong, and {percent(wrong, 1)} % are."
            )


def lowest(rates: Mapping[str, Rates]) -> str | None:
    """Return the variant with the lowest error rate, among those that have masks of all frames.

    ``rates`` are of final masks by variant, with their number of ``frames``. None if no error rate
    is defined.
    """
    most = max((final.get("frames", 0) for final in rates.values()), default=0)
    full = {
        name: final[TESTED]
        for name, final in rates.items()
        if final.get("frames", 0) == most and defined(final[TESTED])
    }
    return min(full, key=full.__getitem__, default=None)


def _best(best: str, rates: Mapping[str, Rates], blind: Difference | None) -> str:
    """Return how wrong the best variant is, and whether it is better than the baseline."""
    several, wrong = len({*rates} - {BASELINE}) > 1, f"{in_percent(rates[best][TESTED]):.1f} %"
    if blind is not None and blind.mean > 0:
        name = (
            f"Nothing here beats {BLIND}: the nearest, {best},"
            if several
            else (f"{best} does not beat {BLIND}: it")
        )
        more = f"{_size(blind.mean, _digits(blind))} pp more{_count_directions(blind)}"
        return f"{name} gets {wrong} of the pixels wrong, {more}; {_doubt(blind)}."
    lead = f"Best here is {best}: " if several else f"{best}: "
    lead += f"{wrong} of the pixels are wrong"
    if blind is None:
        return f"{lead}. No frame with truth was trained on, so {BASELINE} is unknown."
    if not blind.units or blind.is_zero:
        return f"{lead}, as many as with {BLIND}."
    by = f"{_size(blind.mean, _digits(blind))} pp better than {BLIND}{_count_directions(blind)}"
    return f"{lead}. That is {by}; {_doubt(blind)}."


def _in_windows(claims: Mapping[str, Mapping[str, int]] | None) -> str:
    """Return in how many windows the filter lowers the error rate, in brackets."""
    claim = (claims or {}).get("filter_ERR", {})
    if not claim.get("windows"):
        return ""
    return f" (lower in {claim['held']} of {counted(claim['windows'], 'window')})"


def _costs_most(totals: Mapping[str, Rates]) -> str:
    """Return how the filtered variant's error rate comes about, and which step adds most to it.

    The steps start from the error of the first mask, which no step adds. The text is empty without
    an unfiltered variant of the same stages, or if a rate is undefined.
    """
    by_stage, without = totals.get(FILTERED, {}), totals.get(UNFILTERED, {})
    *_, before, last = [None, *by_stage] if len(by_stage) > 1 else [None, None]
    if before is None or last is None or before not in without:
        return ""
    plain, filtered, final = (
        in_percent(mask[TESTED]) for mask in (without[before], by_stage[before], by_stage[last])
    )
    if math.isnan(plain + filtered + final) or not final:
        return ""
    parts = {before: plain, FILTER: filtered - plain, last: final - filtered}
    most = max((FILTER, last), key=parts.__getitem__)
    costs = f"{'the ' * (most == FILTER)}{most} costs most"
    if round(parts[most], 1) <= 0:
        costs = f"no later step adds errors, so {before} costs most"
    return f"Step by step: {step_by_step(parts)}; {costs}."


def step_by_step(parts: Mapping[str, float]) -> str:
    """Return how an error rate comes about, as a clause.

    ``parts`` are in percent: the error of the first mask, and the addition of each further step.

    >>> step_by_step({"svm": 15.0, "filter": -1.2, "post": 0.6})
    'svm without the filter leaves 15.0 % wrong, the filter removes 1.2 pp, post adds 0.6 pp'
    """
    (first, error), *rest = parts.items()
    without = " without the filter" if FILTER in parts else ""
    steps = (
        f"{'the ' * (name == FILTER)}{name} {'adds' if cost >= 0 else 'removes'} {abs(cost):.1f} pp"
        for name, cost in rest
    )
    return ", ".join([f"{first}{without} leaves {error:.1f} % wrong", *steps])


def without_filter(notes: Iterable[str]) -> list[str]:
    """Return a frame's notes without the one on the filter, whose effect is shown apart."""
    return [note for note in notes if not note.startswith(_OF_FILTER)]


def notes_of(tallies: Iterable[Tally]) -> tuple[str, ...]:
    """Return the notes on a frame from its tallies; none on a frame that is not evaluated."""
    finals = {tally.variant: tally.rates for tally in tallies}
    blind = finals.pop(BASELINE, None)
    return tuple(notes(finals, blind))


def notes(
    finals: Mapping[str, Mapping[str, float]], blind: Mapping[str, float] | None
) -> Iterator[str]:
    """Yield what a person should know of a frame, by the final masks' rates and the baseline's."""
    if FILTERED in finals and UNFILTERED in finals:
        change = finals[FILTERED]["ERR"] - finals[UNFILTERED]["ERR"]
        if abs(change) >= NOTEWORTHY:
            verb = "raised" if change > 0 else "lowered"
            yield f"{_OF_FILTER}{verb} ERR by {percent(abs(change), 1)} pp on this frame."
    for name, rates in finals.items():
        if rates["FNR"] >= FAILED_FNR:
            yield f"{name} finds {percent(1 - rates['FNR'], 1)} % of the road."
        elif rates["ERR"] >= FAILED_ERR:
            yield f"{name} gets {percent(rates['ERR'], 1)} % of the pixels wrong."
    for name, rates in finals.items():
        if blind is not None and (excess := rates["ERR"] - blind["ERR"]) >= NOTEWORTHY:
            yield (
                f"{name} is {percent(excess, 1)} pp worse than {BASELINE} "
                f"(ERR {percent(blind['ERR'], 1)} %)."
            )


CLAIMED: Final = {
    "filter_ERR": "ERR is lower with the filter (section 5, figure 3a)",
    "filter_FPR": "FPR is lower with the filter (section 5, figure 3b)",
    "filter_FNR": "FNR is lower with the filter (section 5, figure 3b)",
    "svm_ERR": "ERR of the SVM is lower than that of the colour distance (section 4.3)",
    "post_ERR": "ERR after post-processing is lower than after the SVM (section 4.4)",
}
"""Claims by the names of `CLAIMS` in the scoreboard; the last two are on the filtered variant."""
