"""Notes on a frame for a person, from its rates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from roadeval.data import BASELINE, FILTERED, UNFILTERED, Tally
from roadeval.data.words import percent
from roadeval.evaluation.settings import FAILED_ERR, FAILED_FNR, NOTEWORTHY

Rates = Mapping[str, float]


def of_tallies(tallies: Iterable[Tally]) -> tuple[str, ...]:
    """Return the notes on a frame from its tallies; none on a frame that is not evaluated."""
    finals = {tally.variant: tally.rates for tally in tallies}
    blind = finals.pop(BASELINE, None)
    return tuple(notes(finals, blind))


def notes(finals: Mapping[str, Rates], blind: Rates | None) -> Iterator[str]:
    """Yield what a person should know of a frame, in sentences.

    Parameters
    ----------
    finals
        The rates of each variant's final mask.
    blind
        Those of the baseline, or None.
    """
    if FILTERED in finals and UNFILTERED in finals:
        change = finals[FILTERED]["ERR"] - finals[UNFILTERED]["ERR"]
        if abs(change) >= NOTEWORTHY:
            verb = "raised" if change > 0 else "lowered"
            yield f"The filter {verb} ERR by {percent(abs(change), 1)} pp on this frame."
    for name, rates in finals.items():
        if rates["FNR"] >= FAILED_FNR:
            yield f"{name} finds {percent(rates['TPR'], 1)} % of the road."
        elif rates["ERR"] >= FAILED_ERR:
            yield f"{name} gets {percent(rates['ERR'], 1)} % of the pixels wrong."
    for name, rates in finals.items():
        if blind is not None and (excess := rates["ERR"] - blind["ERR"]) >= NOTEWORTHY:
            yield (
                f"{name} is {percent(excess, 1)} pp worse than {BASELINE}, which never looks at "
                f"the image (ERR {percent(blind['ERR'], 1)} %)."
            )
