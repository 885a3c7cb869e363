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
from roadeval.runtime.sentence import Sentence

FINE: Final = 0.005
"""Levels that differ by less are given with two digits."""
ROUNDING: Final = 5e-4
"""Levels whose difference is farther from the paired one are of other frames."""
MARK: Final = "*"
"""Marks a difference that is significant after correction for all that are stated together."""
NOTHING_SCORED: Final = "Nothing to score: no frame with truth was evaluated."
OVERCONFIDENT: Final = 0.01
"""Least difference of errors and stated errors that is told, see `overconfident`."""
NAMED: Final = 5
"""Frames without truth that a verdict names."""
_OF_FILTER: Final = "The filter "
"""Begins the note on what the filter did to a frame."""
BLIND: Final = f"{BASELINE}, which never looks at the image"


Rates = Mapping[str, Any]
"""Rates of a mask by their names."""


def sentence(
    found: Difference,
    what: str,
    rate: str,
    ends: tuple[Rates, Rates] | None = None,
    *,
    windows: str = "",
    said: str = "",
) -> str:
    """Return what a difference says of these frames or drives, and then of others like them.

    The difference is with ``what`` minus without: ``the filter``, or ``net instead of blind``;
    ``rate`` is what changes, as ``ERR of post``. ``ends`` are the rates without and with it, which
    are given where they are of the same frames or drives; ``windows`` says in how many it is lower,
    in brackets; ``said`` is what a sentence before has said of others like them.

    >>> found = Difference(-0.02, -0.03, -0.01, 0.001, 0.95, "frames", 91)
    >>> sentence(found, "the filter", "ERR")
    'On these 91 frames the filter lowers ERR by 2.0 pp; on frames like these by 1.0 to 3.0 pp.'
    """
    unit = found.unit[:-1]
    if not found.units:
        return f"Nothing to compare: {rate} is undefined on every {unit}."
    here = _here(found)
    if found.is_zero:
        return f"{here} {what} leaves {rate} of every {unit} as it is."
    by = f"by {_size(found.mean, _digits(found))} pp"
    before, after = (each.get(TESTED) for each in ends or ({}, {}))
    if defined(before) and defined(after) and abs(after - before - found.mean) < ROUNDING:
        digits = 1 if abs(found.mean) >= FINE else 2
        by = f"from {_size(before, digits)} to {_size(after, digits)} %"
    doubt = "" if _doubt(found) == said else f"; {_doubt(found)}"
    verb = "raises" if found.mean > 0 else "lowers"
    return f"{here} {what} {verb} {rate} {by}{windows or _counted(found)}{doubt}."


def _doubt(found: Difference) -> str:
    """Return what a difference says of other frames or drives, as a clause."""
    if found.low is None or found.high is None:
        return found.none_because
    like, digits = f"on {found.unit} like these", _digits(found)
    if is_sure(found):
        least, most = sorted((abs(found.low), abs(found.high)))
        return f"{like} by {_size(least, digits)} to {_size(most, digits)} pp"
    family = ""
    if is_sure(replace(found, p_holm=None)):
        family = f" (corrected for {found.comparisons} comparisons)"
    return f"{like} the effect is unclear: {_ends(found.low, found.high, digits)}{family}"


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


def _digits(found: Difference) -> int:
    return 1 if max(abs(found.mean), -(found.low or 0.0), found.high or 0.0) >= 0.01 else 2


def _size(fraction: float, digits: int) -> str:
    return f"{abs(in_percent(fraction)):.{digits}f}"


def _here(found: Difference) -> str:
    if found.unit == "frames":
        return "On this frame" if found.units == 1 else f"On these {found.units} frames"
    groups = (
        "" if found.groups in (None, found.units) else f" in {counted(found.groups or 0, 'group')}"
    )
    return f"Over {counted(found.units, 'drive')}{groups}"


def _counted(found: Difference) -> str:
    if found.worse is None:
        return ""
    if found.unit == "frames":
        return f" (better on {found.better} of {found.units})"
    return f" (worse on {found.worse}, better on {found.better})"


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
"""Reasons of `roadeval.results.facts.FrameAccount`, as they follow a number."""


def account(frames: FrameAccount, windows: int | None = None) -> str:
    """Return how many frames of a log were evaluated, and why the others were not.

    >>> account(FrameAccount(in_log=100, evaluated=90, skipped={"trained on": 10}), 9)
    '90 of 100 frames were evaluated, in 9 windows. Left out: 10 to train on.'
    """
    whole = frames.evaluated if frames.in_log is None else frames.in_log
    of = "" if frames.evaluated == whole else f"{number(frames.evaluated)} of "
    verb = "was" if frames.evaluated == 1 else "were"
    within = f", in {counted(windows, 'window')}" if windows else ""
    told = f"{of}{counted(whole, 'frame')} {verb} evaluated{within}."
    why = [f"{number(count)} {_WHY.get(name, name)}" for name, count in frames.skipped.items()]
    return f"{told} Left out: {', '.join(why)}." if why else told


def is_sure(found: Difference) -> bool:
    """Return whether a difference is there, by its corrected p-value where it has one."""
    p = found.p if found.p_holm is None else found.p_holm
    return p is not None and p < 1 - found.confidence


def is_significant(found: Difference) -> bool:
    """Return whether a difference is there after Holm's correction."""
    return found.p_holm is not None and is_sure(found)


def marked_interval(found: Difference) -> str:
    """Return the interval of a difference, with a mark where it excludes 0 after correction."""
    mark = f" {MARK}" if is_significant(found) else ""
    return interval(found.low, found.high) + mark


def correction(differences: Iterable[Difference]) -> str:
    """Return what a mark on differences of ERR means; empty where none has one."""
    shown = list(differences)
    counts = sorted({each.comparisons for each in shown if each.comparisons})
    if not any(map(is_significant, shown)):
        return ""
    if counts == [1]:
        return f"{MARK} excludes 0; it is the only one, so nothing is corrected."
    many = f"{counts[0]} differences" if len(counts) == 1 else "differences"
    families = "" if len(counts) == 1 else f" against one base ({' and '.join(map(str, counts))})"
    return (
        f"{MARK} significant after Holm's correction for the {many} of ERR of final "
        f"masks{families}; others are not corrected."
    )


def misfit(found: Finding, period_ms: float | None, remedy: str) -> str:
    """Return what does not fit, and what to do, in two sentences.

    ``period_ms`` is the time from one frame to the next, if it is known.

    >>> misfit(Finding("truth", Misfit.LAG, frames=3), 100, "Set `truth.first` to 3.")
    'The truth is 3 frames (300 ms) late: it fits earlier images better. Set `truth.first` to 3.'
    """
    subject, verb = ("The truth", "is") if found.subject == TRUTH else (None, "are")
    subject = subject or f"The masks of {found.subject}"
    match found.misfit:
        case Misfit.LAG:
            size = abs(found.frames)
            time = f" ({size * period_ms:.0f} ms)" if period_ms else ""
            word, which = ("late", "earlier") if found.frames > 0 else ("early", "later")
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
            ways = ((found.right, "right", "left"), (found.down, "down", "up"))
            parts = [f"{abs(n)} pixels {more if n > 0 else less}" for n, more, less in ways if n]
            what = f"moved by {' and '.join(parts)}: moved back {_it(verb)} images and truth better"
    return Sentence("{} {} {}. {}", subject, verb, what, remedy)


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

    Which variant is best, and whether it beats the baseline; what another threshold would bring to
    a method; what tuning and the filter change; and which step adds most to the filtered
    variant's errors.
    ``totals`` are by variant and stage, empty where nothing was scored; ``effects`` are of final
    masks at least; ``claims`` says in how many windows of a drive each claim of the paper holds,
    ``thresholds`` what other thresholds would bring on it, see `at_thresholds`. Where nothing was
    scored, ``unlabelled`` says which frames to look at. ``estimated`` is what frames that were
    drawn at random say of the whole drive.
    """
    if not totals:
        return " ".join([NOTHING_SCORED, *without_truth(unlabelled)])
    stages = final_stages((variant, stage) for variant, own in totals.items() for stage in own)
    rates = {variant: totals[variant][stage] for variant, stage in stages.items()}
    finals = {(each.base, each.variant): each for each in effects if each.final}
    best = lowest({name: each for name, each in rates.items() if name != BASELINE})
    if best is None:
        return f"Nothing to compare: {TESTED} is undefined on every frame."
    against = finals.get((BASELINE, best))
    blind = None if against is None else against.rates[TESTED]
    parts = [_best(best, rates, blind)]
    if whole := [*from_labels(estimated, best)]:
        parts = [*whole, f"On these alone: {parts[0]}"]
    parts += at_thresholds(thresholds or {}, rates)
    for base, variant in (pair for pair in finals if pair[1] == pair[0] + TUNED):
        found, ends = finals[base, variant].rates[TESTED], (rates[base], rates[variant])
        parts.append(sentence(found, f"tuning {base}", f"{TESTED} of {stages[variant]}", ends))
    of_filter = finals.get((UNFILTERED, FILTERED))
    if of_filter is not None and of_filter.rates[TESTED].units:
        parts.append(
            sentence(
                *(of_filter.rates[TESTED], "the filter", f"{TESTED} of {of_filter.stage}"),
                (rates[UNFILTERED], rates[FILTERED]),
                windows=_in_windows(claims),
                said=_doubt(blind) if blind else "",
            )
        )
    return " ".join(filter(None, [*parts, _costs_most(totals)]))


RANKED_BY: Final = {
    "entropy": "{variant} is least sure where road is (entropy of its probability)",
    "disagreement": "{variant} and the other variants differ most",
    "flicker": "the mask of {variant} changes most from the frame before",
}
"""Why frames without truth come first, by what ranks them."""


def without_truth(found: UnlabelledFacts | None) -> Iterator[str]:
    """Yield what is known without truth: a bound on the greater of two error rates, and a rank."""
    if found is None:
        return
    pairs = [(e, one, other) for one, own in found.differing.items() for other, e in own.items()]
    if pairs:
        share, one, other = max(pairs, key=itemgetter(0))
        yield (
            f"{one} and {other} differ on {percent(share, 1)} % of the pixels, so one of the two "
            f"is wrong on at least {math.floor(share * 500) / 10:.1f} %."
        )
    if found.look_at and found.sign:
        why = RANKED_BY[found.sign].format(variant=found.variant)
        frames = listing([str(each) for each in found.look_at[:NAMED]])
        yield f"Look first at frames {frames}: there {why}. That is a rank, and no error rate."


def from_labels(found: EstimateFacts | None, variant: str) -> Iterator[str]:
    """Yield a variant's error rate on the whole drive, from its labelled frames, in a sentence."""
    own = found.rates.get(variant, {}).get(TESTED) if found else None
    if found is None or own is None:
        return
    ends = "no interval yet"
    if own.low is not None and own.high is not None:
        ends = f"{percent(own.low, 1)} to {percent(own.high, 1)}"
    more = ""
    if own.to_halve:
        more = f"; {number(own.to_halve)} more drawn at random would halve that interval"
    yield (
        f"{variant}: {TESTED} {percent(own.mean, 1)} % ({ends}) from {number(own.labels)} labelled "
        f"frames, drawn at random, of {number(own.frames)}{more}. Errors on up to "
        f"{percent(own.missed, 0)} % of the frames may be missed by so few."
    )
    if own.unseen:
        yield (
            f"{number(own.unseen)} frames are far more in doubt than any that was drawn: the upper "
            "end takes them for wrong altogether. More labels, drawn at random, would tell."
        )
    worst = sorted((-(e.get(variant) or 0.0), frame) for frame, e in found.apart.items())
    if shown := [f"{frame} ({percent(-error, 1)} %)" for error, frame in worst[:NAMED]]:
        yield f"Frames that were picked by rank are not in it; the worst: {listing(shown)}."


def at_thresholds(
    thresholds: Mapping[str, Mapping[str, Any]], rates: Mapping[str, Rates]
) -> Iterator[str]:
    """Yield what the threshold of the training frames would bring to each method, in a sentence.

    Parameters
    ----------
    thresholds
        As in `roadeval.results.facts.Facts`.
    rates
        Those of final masks by variant. Where ERR would hardly change nothing is said.
    """
    for name, found in thresholds.items():
        now = rates.get(name, {}).get(f"pooled_{TESTED}", math.nan)
        if abs(now - found[TESTED]) >= ROUNDING:
            digits = 1 if abs(now - found[TESTED]) >= FINE else 2
            lines = "` and `".join(found.get("lines", "").splitlines())
            yield (
                f"{name} at {found['threshold']:.2g} instead of {found['own']:.2g}, which the "
                f"training frames choose: {in_percent(found[TESTED]):.{digits}f} instead of "
                f"{in_percent(now):.{digits}f} %{f' (write `{lines}`)' if lines else ''}."
            )


def overconfident(curves: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Iterator[str]:
    """Yield a sentence on each variant that errs twice as often as its probabilities say, or more.

    ``curves`` are as in `roadeval.results.facts.Facts`. Less than a point of difference is none.
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
    """Return the variant with the lowest error rate, of those that have masks of all frames.

    ``rates`` are those of final masks by variant, with their number of ``frames``. None if no error
    rate is defined.
    """
    most = max((each.get("frames", 0) for each in rates.values()), default=0)
    full = {
        name: each[TESTED]
        for name, each in rates.items()
        if each.get("frames", 0) == most and defined(each[TESTED])
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
        more = f"{_size(blind.mean, _digits(blind))} pp more{_counted(blind)}"
        return f"{name} gets {wrong} of the pixels wrong, {more}; {_doubt(blind)}."
    lead = f"Best here is {best}: " if several else f"{best}: "
    lead += f"{wrong} of the pixels are wrong"
    if blind is None:
        return f"{lead}. No frame with truth was trained on, so {BASELINE} is unknown."
    if not blind.units or blind.is_zero:
        return f"{lead}, as many as with {BLIND}."
    by = f"That is {_size(blind.mean, _digits(blind))} pp better than {BLIND}{_counted(blind)}"
    return f"{lead}. {by}; {_doubt(blind)}."


def _in_windows(claims: Mapping[str, Mapping[str, int]] | None) -> str:
    """Return in how many windows the filter lowers the error rate, in brackets."""
    found = (claims or {}).get("filter_ERR", {})
    if not found.get("windows"):
        return ""
    return f" (lower in {found['held']} of {counted(found['windows'], 'window')})"


def _costs_most(totals: Mapping[str, Rates]) -> str:
    """Return how the filtered variant's error rate comes about, and which step adds most to it.

    The first mask's own error is what the steps after it start from, and no step's addition.
    Empty without an unfiltered variant of the same stages, or where a rate is undefined.
    """
    own, without = totals.get(FILTERED, {}), totals.get(UNFILTERED, {})
    *_, before, last = [None, *own] if len(own) > 1 else [None, None]
    if before is None or last is None or before not in without:
        return ""
    plain, filtered, final = (
        in_percent(each[TESTED]) for each in (without[before], own[before], own[last])
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

    ``parts`` are in percent: the error of a first mask, and what each further step adds.

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
    """Return a frame's notes without that on the filter, where its part of ERR is shown."""
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
"""By the names of `CLAIMS` in the scoreboard; the last two are of the filtered variant."""
