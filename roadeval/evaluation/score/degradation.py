"""How much worse a variant is on disturbed images than on the same frames as they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.difference import Difference, holm, within_drive
from roadeval.evaluation.tables import KEY, finals, group_rows, only, pair_rows
from roadeval.images.disturbing import Disturbance

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Degradation:
    """ERR of a variant's final mask under a disturbance, and without it on the same frames."""

    kind: str
    strength: float
    ERR: float | None
    base_ERR: float | None  # noqa: N815
    difference: Difference

    @property
    def disturbance(self) -> str:
        """The disturbance as it is typed, as ``fog:2``."""
        return str(Disturbance(self.kind, self.strength))


Degradations = dict[str, dict[str, Degradation]]
"""By variant, and by the disturbance's name."""


def degradations(
    disturbed: pd.DataFrame, frames: pd.DataFrame, settings: EvaluationSettings
) -> Degradations:
    """Compare the final masks of disturbed frames with those of the frames as they are.

    ``disturbed`` has their counts by ``disturbance``, as ``fog:2``; ``frames`` is the table of this
    name of a drive. The mean of several cameras is that of their means.
    """
    last, changes = finals(frames), dict[tuple[str, str], Degradation]()
    for (variant, text), rows in group_rows(disturbed, ["variant", "disturbance"]):
        pairs = pair_rows(only(last, variant=variant), rows, [*KEY, "frame", "stamp_ns"])
        both = pairs[[f"{TESTED}_base", TESTED]].dropna()
        base, error = both.groupby(pairs["camera"]).mean().mean()
        difference = within_drive(pairs, TESTED, settings)
        disturbance = Disturbance.parse(text)
        change = Degradation(*disturbance, float(error), float(base), difference)
        changes[variant, disturbance.name] = change
    return as_corrected(changes)


def as_corrected(changes: Mapping[tuple[str, str], Degradation]) -> Degradations:
    """Return changes by variant and disturbance, corrected for their number."""
    family = holm([change.difference for change in changes.values()])
    corrected: Degradations = {}
    for ((variant, name), change), difference in zip(changes.items(), family, strict=True):
        corrected.setdefault(variant, {})[name] = replace(change, difference=difference)
    return corrected
