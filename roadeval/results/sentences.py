"""A result in words: differences, the verdict, frames and their labels, and the paper's claims."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED, Tally
from roadeval.data.words import counted, first_of, interval, number, percent
from roadeval.evaluation.score.fit import TRUTH, Finding, Misfit
from roadeval.evaluation.score.label_errors import LabelFlaw
from roadeval.evaluation.settings import FAILED_ERR, FAILED_FNR, NOTEWORTHY
from roadeval.evaluation.stats.difference import Difference
from roadeval.results.facts import FrameAccount
from roadeval.runtime.sentence import Sentence

if TYPE_CHECKING:
    import pandas as pd

FINE: Final = 0.005
"""Levels that differ by less have two digits."""
ROUNDING: Final = 5e-4
"""If the difference of two levels is farther from the paired one, they are of other frames."""
MARK: Final = "*"
"""The mark of a difference that is significant after correction for all that are shown together."""
OVERCONFIDENT: Final = 0.01
"""Least difference between errors and stated errors that `describe_overconfidence` reports."""

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
    """Return what a mark on differences of ERR means; empty if none has a mark."""
    marked = list(differences)
    counts = sorted({shown.comparisons for shown in marked if shown.comparisons})
    if not any(map(is_significant, marked)):
        return ""
    if counts == [1]:
        return f"{MARK} ERR, with an interval that does not contain 0."
    return (
        f"{MARK} not chance, even though several are compared (Holm's correction); rows without it "
        "may be chance."
    )


def misfit(finding: Finding, period_ms: float | None, remedy: str) -> str:
    """Return two sentences: what does not fit, and what to do.

    ``period_ms`` is the time from one frame to the next, if it is known.

    >>> misfit(Finding("truth", Misfit.LAG, frames=3), 100, "Set `truth.first` to 3.")
    'The truth is 3 frames (300 ms) late: it fits earlier images better. Set `truth.first` to 3.'
    """
    subject, verb, it = "The truth", "is", "it fits"
    if finding.subject != TRUTH:
        subject, verb, it = f"The masks of {finding.subject}", "are", "they fit"
    match finding.misfit:
        case Misfit.LAG:
            size = abs(finding.frames)
            time = f" ({size * period_ms:.0f} ms)" if period_ms else ""
            word, which = ("late", "earlier") if finding.frames > 0 else ("early", "later")
            what = f"{counted(size, 'frame')}{time} {word}: {it} {which} images better"
        case Misfit.MIRRORED:
            what = f"mirrored: with left and right exchanged {it} the images better"
        case Misfit.UPSIDE_DOWN:
            what = f"upside down: turned over {it} the images better"
        case Misfit.INVERTED:
            what = (
                "inverted, or of another class: road is high in the image, not before the vehicle"
            )
        case _:
            ways = ((finding.right, "right", "left"), (finding.down, "down", "up"))
            parts = [f"{abs(n)} pixels {more if n > 0 else less}" for n, more, less in ways if n]
            what = f"moved by {' and '.join(parts)}: moved back {it} images and truth better"
    return Sentence("{} {} {}. {}", subject, verb, what, remedy)


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


def notes_of(tallies: Iterable[Tally]) -> tuple[str, ...]:
    """Return the notes on a frame from its tallies; none on a frame that is not evaluated."""
    finals = {tally.variant: tally.rates for tally in tallies}
    return tuple(notes(finals))


def notes(finals: Mapping[str, Mapping[str, float]], focus: str | None = None) -> Iterator[str]:
    """Yield notes on a frame for a person, by the rates of final masks.

    With a ``focus`` they are about this variant alone, and do not repeat its rates.
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
_FLAWS: Final[Mapping[str, str]] = {
    LabelFlaw.ANOTHER_FRAME: "it is the label of frame {}",
    LabelFlaw.MIRRORED: "left and right are exchanged",
    LabelFlaw.MOVED: "it lies {} of its place",
    LabelFlaw.SPECKS: "specks or holes that nothing else has",
    LabelFlaw.JUMP: "the labels before and after say {} in the same place",
    LabelFlaw.METHODS: "methods that are right at this place in other frames see {}",
}


def describe_suspect(suspect: Mapping[str, Any]) -> str:
    """Return why a label looks wrong, by a row of the suspects.

    >>> describe_suspect({"reason": "moved", "detail": "12,-4"})
    'it lies 12 px right and 4 px above of its place'
    """
    detail = str(suspect["detail"])
    if suspect["reason"] == LabelFlaw.MOVED:
        ways = zip(map(int, detail.split(",")), ("right left", "below above"), strict=True)
        detail = " and ".join(f"{abs(by)} px {words.split()[by < 0]}" for by, words in ways if by)
    return _FLAWS[suspect["reason"]].format(detail)


def describe_suspects(suspects: pd.DataFrame) -> str:
    """Return a sentence on the frames with clearly wrong labels, from the ranked suspects."""
    frames = sorted(suspects[suspects["clear"]]["frame"].tolist())
    if len(frames) < 2:
        is_wrong = f"The label of frame {frames[0]} looks wrong." if frames else ""
        return is_wrong or "No label is clearly wrong."
    named = first_of([*map(str, frames)], 10)
    return f"The labels of {len(frames)} frames look wrong: {named}."


def describe_annotator(name: str, share: float, frames: int) -> str:
    """Return the meaning of the share of pixels that two people label differently.

    >>> print(describe_annotator("b", 0.009, 20).partition(":")[0])
    b and the truth differ on 0.9 % of the pixels of 20 frames
    """
    return (
        f"{name} and the truth differ on {percent(share, 1)} % of the pixels of "
        f"{counted(frames, 'frame')}: differences of ERR below that mean nothing."
    )
