"""A result in words: differences, the verdict, notes on frames, and the paper's claims."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED, Tally
from roadeval.data.words import counted, interval, number, percent
from roadeval.evaluation.score.degradation import Degradations
from roadeval.evaluation.score.fit import TRUTH, Finding, Misfit
from roadeval.evaluation.settings import FAILED_ERR, FAILED_FNR, NOTEWORTHY
from roadeval.evaluation.stats.difference import Difference
from roadeval.evaluation.stats.slices import Condition, Slice
from roadeval.evaluation.tables import by_class, only
from roadeval.results.facts import FrameAccount
from roadeval.results.schema import TAG
from roadeval.runtime.sentence import Sentence

if TYPE_CHECKING:
    import pandas as pd

FINE: Final = 0.005
"""Levels that differ by less have two digits."""
ROUNDING: Final = 5e-4
"""If the difference of two levels is farther from the paired one, they are of other frames."""
MARK: Final = "*"
"""Marks a difference that is significant after correction for all that are shown together."""
OVERCONFIDENT: Final = 0.01
"""Least difference between errors and stated errors that `describe_overconfidence` reports."""
_TIMES: Final = {
    1000.0: ("raises", ""),
    3.5: ("multiplies", " by {:.0f}"),
    2.5: ("triples", ""),
    1.75: ("doubles", ""),
}
"""Words for a rise, by the least ratio."""

Rates = Mapping[str, Any]
"""Rates of a mask by their names."""


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


def account(frames: FrameAccount, windows: int = 0, size: int = 10) -> str:
    """Return how many frames of a log were evaluated, and why the others were not.

    ``windows`` are the groups of ``size`` frames that they make.

    >>> account(FrameAccount(in_log=100, evaluated=90, skipped={"trained on": 10}), 9)
    '90 of 100 frames were evaluated, in 9 groups of 10. Left out: 10 to train on.'
    """
    total = frames.evaluated if frames.in_log is None else frames.in_log
    of = "" if frames.evaluated == total else f"{number(frames.evaluated)} of "
    verb = "was" if frames.evaluated == 1 else "were"
    within = f", in {counted(windows, 'group')} of {size}" if windows else ""
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
        return f"{MARK} the interval does not contain 0."
    return (
        f"{MARK} not chance, even though several are compared (Holm's correction); rows without it "
        "may be chance."
    )


def describe_disturbances(disturbances: Degradations, focus: str | None) -> str:
    """Return which disturbance harms the focus most, and how many do; empty without any.

    A variant that was not disturbed gives way to the first one that was.
    """
    if not disturbances:
        return ""
    variant = focus if focus in disturbances else next(iter(disturbances))
    changes = [c for c in disturbances[variant].values() if c.difference.mean > 0]
    if not changes:
        return f"No disturbance makes {variant} worse."
    worst = max(changes, key=lambda change: change.difference.mean)
    base, error = worst.base_ERR or 0.0, worst.ERR or 0.0
    times = error / base if base else math.inf
    does, by = next((words for least, words in _TIMES.items() if times >= least), ("raises", ""))
    ends = f"{percent(base, 1)} to {percent(error, 1)} %"
    sure = sum(is_significant(change.difference) for change in changes)
    makes = "makes" if sure == 1 else "make"
    more = f" {sure} of {len(disturbances[variant])} {makes} it worse beyond chance."
    most = f"{worst.text} {does} the ERR of {variant}{by.format(times)}: {ends}."
    return f"{most}{more * bool(sure)}"


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
    return Sentence("{} {} {}. {}", subject, verb, what, remedy)


def _it(verb: str) -> str:
    return "it fits" if verb == "is" else "they fit"


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


NAMED: Final = 3
"""Most classes that a sentence names."""
LEAST_WRONG: Final = 0.001
"""Less false road, or missed road, than this share of the pixels makes no sentence."""


def describe_classes(classes: pd.DataFrame, variant: str) -> dict[str, str]:
    """Return which classes the false road of a variant is, and which lie beside its missed road.

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
            parts = [f"{percent(most, 0)} % of the {kind} road {verb} {first}"]
            parts += [f"{percent(part, 0)} % {beside}{n}" for n, part in others if part >= 0.1]
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
"""Words behind "frames" for each quantity, and those for below and above its limit."""


def describe_condition(condition: Condition) -> str:
    """Return a condition as words behind "frames".

    >>> describe_condition(Condition("shadow", ">", 0.3))
    'with more than 30 % shade'
    >>> describe_condition(Condition("hour", "<", 17.5))
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

    >>> shade = Condition("shadow", ">", 0.3)
    >>> describe_slice(Slice([shade], "20-80m", 90, 0.31, 0.1, 3.1, 1.8, 4.9, 0.01))
    'In frames with more than 30 % shade, 20 to 80 m ahead, ERR is 3.1 times the rest (1.8 to 4.9).'
    """
    words = describe_place(failure)
    return (
        f"{words[0].upper()}{words[1:]}, ERR is {failure.ratio:.1f} times the rest "
        f"({failure.low:.1f} to {failure.high:.1f})."
    )


def describe_place(failure: Slice) -> str:
    """Return which frames, and which part of them, a slice is."""
    conditions = " and ".join(map(describe_condition, failure.conditions))
    parts = [
        f"in frames {conditions}" * bool(conditions),
        failure.part and describe_part(failure.part),
    ]
    return ", ".join(filter(None, parts))


def notes_of(tallies: Iterable[Tally]) -> tuple[str, ...]:
    """Return the notes on a frame from its tallies; none on a frame that is not evaluated."""
    finals = {tally.variant: tally.rates for tally in tallies}
    return tuple(notes(finals))


def notes(finals: Mapping[str, Mapping[str, float]], focus: str | None = None) -> Iterator[str]:
    """Yield what a person should know of a frame, by the rates of final masks.

    With a ``focus`` they are about this variant alone, beside its rates.
    """
    blind = finals.get(BASELINE)
    variants = [name for name in finals if name != BASELINE and focus in (None, name)]
    if FILTERED in variants and UNFILTERED in finals:
        change = finals[FILTERED]["ERR"] - finals[UNFILTERED]["ERR"]
        if abs(change) >= NOTEWORTHY:
            verb = "raised" if change > 0 else "lowered"
            yield f"The filter {verb} ERR by {percent(abs(change), 1)} points on this frame."
    for name in variants if focus is None else ():
        rates = finals[name]
        if rates["FNR"] >= FAILED_FNR:
            yield f"{name} finds {percent(1 - rates['FNR'], 1)} % of the road."
        elif rates["ERR"] >= FAILED_ERR:
            yield f"{name} gets {percent(rates['ERR'], 1)} % of the pixels wrong."
    for name in variants:
        if blind and (excess := finals[name]["ERR"] - blind["ERR"]) >= NOTEWORTHY:
            yield (
                f"{name} is {percent(excess, 1)} points worse than {BASELINE} "
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
