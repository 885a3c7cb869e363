"""Why a variant fails, in a few sentences: what is confirmed, and the frames that show it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import TYPE_CHECKING, Final

from roadeval.data import BASELINE
from roadeval.evaluation.tables import by_class, only
from roadeval.results.facts import Facts, FleetFacts
from roadeval.results.sentences import (
    describe_classes,
    describe_disturbances,
    describe_slice,
    is_significant,
)

if TYPE_CHECKING:
    import pandas as pd

MOST: Final = 4
"""Most sentences about a variant."""


def explain(facts: Facts | FleetFacts, classes: pd.DataFrame) -> dict[str, list[str]]:
    """Return the sentences about each variant; none about one of which nothing is confirmed.

    They name the class of its false road and the class beside its missed road, the condition under
    which it errs most, and the disturbance that harms it most. ``classes`` are the rows of the
    table of that name.
    """
    variants = (name for name in facts.finals if name != BASELINE)
    sentences = {name: [*islice(_reasons(facts, classes, name), MOST)] for name in variants}
    return {name: reasons for name, reasons in sentences.items() if reasons}


def _reasons(facts: Facts | FleetFacts, classes: pd.DataFrame, variant: str) -> Iterator[str]:
    """Yield what is confirmed about a variant: of its classes, its conditions, its disturbances."""
    rows = only(classes, variant=variant)
    for kind, sentence in describe_classes(rows, variant).items():
        shares = by_class(rows).sort_values(kind, ascending=False, kind="stable")
        numbers = shares["worst"].iloc[0].split() if isinstance(facts, Facts) else []
        yield with_frames(sentence, numbers)
    for confirmed in facts.slices.get(variant, [])[:1]:
        numbers = [] if confirmed.drives else [*map(str, confirmed.worst)]
        yield with_frames(describe_slice(confirmed), numbers)
    changes = facts.disturbances.get(variant, {})
    if any(is_significant(change.difference) for change in changes.values()):
        yield describe_disturbances({variant: changes}, variant)


def with_frames(sentence: str, numbers: list[str]) -> str:
    """Return a sentence with the frames that show it.

    >>> with_frames("All is dark.", ["3", "50"])
    'All is dark; see frames 3, 50.'
    """
    word = "frames" if len(numbers) > 1 else "frame"
    return f"{sentence.rstrip('.')}; see {word} {', '.join(numbers)}." if numbers else sentence
