"""How much worse a variant is on disturbed images than on the same images undisturbed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from roadeval.data import as_tree
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
    def text(self) -> str:
        """The disturbance as the user writes it, such as ``fog:2``."""
        return str(Disturbance(self.kind, self.strength))


Degradations = dict[str, dict[str, Degradation]]
"""Degradations by variant, and by the disturbance's name, such as ``fog-2``."""


def degradations(
    disturbed: pd.DataFrame, frames: pd.DataFrame, settings: EvaluationSettings
) -> Degradations:
    """Compare final masks of disturbed frames with the masks in the table ``frames`` of a drive.

    ``disturbed`` has their counts by ``disturbance``, such as ``fog:2``. With several cameras, ERR
    is the mean of the cameras' means.
    """
    last, changes = finals(frames), dict[tuple[str, str], Degradation]()
    for (variant, text), rows in group_rows(disturbed, ["variant", "disturbance"]):
        pairs = pair_rows(only(last, variant=variant), rows, [*KEY, "frame", "stamp_ns"])
        both = pairs[[TESTED, f"{TESTED}_base"]].dropna().groupby(pairs["camera"])
        error, base = map(float, both.mean().mean())
        disturbance, difference = Disturbance.parse(text), within_drive(pairs, TESTED, settings)
        changes[variant, disturbance.name] = Degradation(*disturbance, error, base, difference)
    return as_corrected(changes)


def as_corrected(changes: Mapping[tuple[str, str], Degradation]) -> Degradations:
    """Return changes by variant and disturbance, with p-values corrected for their number."""
    family = holm([change.difference for change in changes.values()])
    corrected = zip(changes.items(), family, strict=True)
    return as_tree((names, replace(change, difference=d)) for (names, change), d in corrected)
