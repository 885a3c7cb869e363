"""How far rates depend on what the training draws, in numbers and in a sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, Final

from roadeval.data import FILTERED, FINAL_STAGE, UNFILTERED
from roadeval.data.words import defined, listing, percent, plain_points

JUDGED: Final = "ERR"
"""The rate of the sentence."""


@dataclass(frozen=True, slots=True)
class Spread:
    """The middle of some values, the least and the greatest."""

    middle: float
    least: float
    greatest: float

    @classmethod
    def of(cls, values: Sequence[float | None]) -> Spread | None:
        """Return the spread of the values that are defined; None where none is."""
        known = [value for value in values if defined(value)]
        return cls(median(known), min(known), max(known)) if known else None


def spreads(by_seed: Mapping[str, Sequence[float | None]]) -> dict[str, Spread | None]:
    """Return the spread of each rate, from its values with each seed."""
    return {rate: Spread.of(values) for rate, values in by_seed.items()}


def in_words(spread: Spread | None) -> str:
    """Return a rate's spread in percent.

    >>> in_words(Spread(0.02, 0.01, 0.04))
    '2.00 (1.00 to 4.00)'
    """
    if spread is None:
        return percent(None)
    return f"{percent(spread.middle)} ({percent(spread.least)} to {percent(spread.greatest)})"


def seeds_in_words(seeds: Mapping[str, Any]) -> str:
    """Name the seeds of ``seeds`` in ``summary.json``.

    >>> seeds_in_words({"seeds": [3, 4, 5]})
    'seeds 3 to 5'
    """
    first, *_, last = seeds["seeds"]
    return f"seeds {first} to {last}"


def sentence(seeds: Mapping[str, Any]) -> str:
    """Return what other seeds make of the final masks' ERR and of the filter's effect.

    Parameters
    ----------
    seeds
        As ``seeds`` in ``summary.json``.
    """
    errors = {
        variant: spread
        for variant, stages in seeds["totals"].items()
        if (spread := Spread.of(stages[FINAL_STAGE][JUDGED]))
    }
    parts = [
        f"{variant} {percent(spread.least)} to {percent(spread.greatest)} % (middle "
        f"{percent(spread.middle)})"
        for variant, spread in errors.items()
    ]
    effects = seeds["difference"].get(FINAL_STAGE, {}).get(JUDGED, ())
    if effect := Spread.of(effects):
        parts.append(
            f"{FILTERED} minus {UNFILTERED} {plain_points(effect.least)} to "
            f"{plain_points(effect.greatest)} pp (middle {plain_points(effect.middle)})"
        )
    begin = f"With {seeds_in_words(seeds)} of the training"
    if not parts:
        return f"{begin} {JUDGED} of {FINAL_STAGE} is undefined on every frame."
    return (
        f"{begin} {JUDGED} of {FINAL_STAGE} is: {listing(parts)}. Tables and recording are those "
        f"of seed {seeds['seeds'][0]}."
    )
