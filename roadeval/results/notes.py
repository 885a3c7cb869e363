"""Notes on a frame for a person, from its rates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from roadeval.data import BASELINE, FILTERED, UNFILTERED, Tally
from roadeval.data.words import percent
from roadeval.evaluation.settings import EvaluationSettings

Rates = Mapping[str, float]


def of_tallies(tallies: Iterable[Tally], settings: EvaluationSettings) -> tuple[str, ...]:
    """Return the notes on a frame from its tallies; none on a frame that is not evaluated."""
    finals = {tally.variant: tally.rates for tally in tallies}
    blind = finals.pop(BASELINE, None)
    return notes(finals, blind, settings)


def notes(
    finals: Mapping[str, Rates], blind: Rates | None, settings: EvaluationSettings
) -> tuple[str, ...]:
    """Return what a person should know of a frame, in sentences.

    Parameters
    ----------
    finals
        The rates of each variant's final mask.
    blind
        Those of the baseline, or None.
    settings
        The thresholds.
    """
    return (
        *_filter_note(finals, settings),
        *(note for name, rates in finals.items() for note in _failures(name, rates, settings)),
        *_blind_notes(finals, blind, settings),
    )


def _filter_note(finals: Mapping[str, Rates], settings: EvaluationSettings) -> Iterator[str]:
    if FILTERED not in finals or UNFILTERED not in finals:
        return
    change = finals[FILTERED]["ERR"] - finals[UNFILTERED]["ERR"]
    if abs(change) >= settings.noteworthy:
        verb = "raised" if change > 0 else "lowered"
        yield f"The filter {verb} ERR by {percent(abs(change), 1)} pp on this frame."


def _failures(name: str, rates: Rates, settings: EvaluationSettings) -> Iterator[str]:
    if rates["FNR"] >= settings.failed_fnr:
        yield f"{name} finds {percent(rates['TPR'], 1)} % of the road."
    elif rates["ERR"] >= settings.failed_err:
        yield f"{name} gets {percent(rates['ERR'], 1)} % of the pixels wrong."


def _blind_notes(
    finals: Mapping[str, Rates], blind: Rates | None, settings: EvaluationSettings
) -> Iterator[str]:
    if blind is None:
        return
    for name, rates in finals.items():
        excess = rates["ERR"] - blind["ERR"]
        if excess >= settings.noteworthy:
            yield (
                f"{name} is {percent(excess, 1)} pp worse than {BASELINE}, which never looks at "
                f"the image (ERR {percent(blind['ERR'], 1)} %)."
            )
