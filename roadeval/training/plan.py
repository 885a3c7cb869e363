"""What a variant's chain is, as training and model files need to know it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from roadeval.pipeline.chain import STAGES
from roadeval.pipeline.stage import Stage


@dataclass(frozen=True, slots=True)
class Plan:
    """A variant's stages, in the order they run, and the settings of each."""

    chain: tuple[str, ...]
    settings: Mapping[str, Any]

    def learning(self) -> tuple[str, ...]:
        """Name the stages that learn."""
        return tuple(name for name in self.chain if STAGES[name].fit is not None)

    def relevant(self) -> dict[str, dict[str, Any]]:
        """Give the settings that what is learnt depends on, by stage: filters, and `learning`."""
        learning = self.learning()
        names = [name for name in self.chain if name in learning or not STAGES[name].yields_mask]
        return {name: _relevant(STAGES[name], self.settings[name]) for name in names}


def _relevant(stage: Stage[Any, Any], settings: Any) -> dict[str, Any]:
    """Leave the settings out that only the stage's decision follows."""
    every = dataclasses.asdict(settings)
    return {key: value for key, value in every.items() if key not in stage.deciding}
