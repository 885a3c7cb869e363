"""The weighted mean of the log-odds by trees and by a network, and one such mean on another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.forest import Forest
from roadeval.pipeline.beyond.hidden_layer import HiddenLayer


@dataclass(frozen=True, slots=True, eq=False)
class Blend:
    """A forest and a network that learnt from the same pixels.

    Parameters
    ----------
    forest, network
        They see the same features.
    """

    forest: Forest
    network: HiddenLayer

    def __post_init__(self) -> None:
        if self.forest.inputs != self.network.inputs:
            raise ValueError(
                f"the forest sees {self.forest.inputs} features of a pixel, and the network "
                f"{self.network.inputs}"
            )

    @property
    def inputs(self) -> int:
        """How many features of a pixel both see."""
        return self.network.inputs

    def log_odds(self, values: Values, weight: Values | float) -> Values:
        """Return the weighted mean of both for each pixel, ``(n,)`` float32.

        Parameters
        ----------
        values
            ``(inputs, n)`` features.
        weight
            The network's, 0 to 1: one, or ``(n,)``.
        """
        trees, network = self.forest.sums(values), self.network.sums(values)
        mean: Values = trees + np.asarray(weight, np.float32) * (network - trees)
        return mean


@dataclass(frozen=True, slots=True, eq=False)
class Stack:
    """A blend, and the one of other drives that it was taught on top of, if any.

    Parameters
    ----------
    top
        Its last feature is what the base gives, where there is one.
    base
        None: there is none.
    """

    top: Blend
    base: Blend | None = None

    def __post_init__(self) -> None:
        if self.base is not None and self.top.inputs != self.base.inputs + 1:
            raise ValueError(
                f"what stands on top sees {self.top.inputs} features of a pixel, and the base "
                f"{self.base.inputs}"
            )

    @property
    def inputs(self) -> int:
        """How many features of a pixel are given to it."""
        return (self.base or self.top).inputs

    def log_odds(self, values: Values, weight: Values | float) -> Values:
        """Return what the blend on top gives for each pixel, ``(n,)`` float32.

        ``values`` and ``weight`` are as in `Blend.log_odds`; both blends take the same weight.
        """
        if self.base is not None:
            known = self.base.log_odds(values, weight)
            values = np.concatenate([values, known[None]])
        return self.top.log_odds(values, weight)
