"""Trees and a network with one hidden layer, and the weighted mean of their log-odds."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.forest import Forest
from roadeval.pipeline.beyond.hidden_layer import CODES, HiddenLayer
from roadeval.pipeline.parameters import check_arrays


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Blend(Forest):
    """A forest, and the networks that learnt from the same pixels.

    `opinions` are those of both; `sums` are the trees' alone, as of any forest.

    Parameters
    ----------
    lowest, scale, ranks, planes, bias, weights, shift
        Those of `HiddenLayer`, with the networks along a first axis: one, or, where the forest has
        a base, that of the base and then that on top of it. What the base gives is the last
        feature; the network of the base has no weight for it.
    """

    lowest: Values
    scale: Values
    ranks: Values
    planes: Values
    bias: Values
    weights: Values
    shift: Values

    def __post_init__(self) -> None:
        Forest.__post_init__(self)
        seen, count = self.inputs + (self.base > 0), 1 + (self.base > 0)
        check_arrays(self, np.float32, lowest=(count, seen), scale=(count, seen), shift=(count,))
        check_arrays(self, np.float32, ranks=(count, seen, CODES), planes=(count, "K", seen))
        planes = self.planes.shape[1]
        check_arrays(self, np.float32, bias=(count, planes), weights=(count, planes))

    @classmethod
    def of(cls, forest: Forest, network: HiddenLayer) -> Self:
        """Return both in one."""
        parts = _named(network, HiddenLayer)
        stacked = {name: np.stack([np.float32(value)]) for name, value in parts.items()}
        return cls(**_named(forest, Forest) | stacked)

    def opinions(self, values: Values, weight: Values | float) -> Values:
        """Return the mean of both opinions on each pixel, ``(n,)`` float32.

        Parameters
        ----------
        values
            ``(inputs, n)`` features.
        weight
            The network's, 0 to 1: one, or ``(n,)``.
        """
        if self.base:
            trees = self._sum(values, slice(self.base), self.base_offset)
            first = _mean(trees, self._network(0, self.inputs).sums(values), weight)
            values = np.concatenate([values, first[None]])
        trees = self._sum(values, slice(self.base, None), self.offset)
        return _mean(trees, self._network(-1, len(values)).sums(values), weight)

    def on_top(self, base: Forest) -> Blend:
        """Return both in one: what ``base`` gives is the last feature of these."""
        if not isinstance(base, Blend):
            raise TypeError("the base is no blend")
        forest = Forest.on_top(self, base)
        known = _named(base._network(0, base.inputs), HiddenLayer)
        own = _named(self._network(0, self.inputs), HiddenLayer)
        for name, side in (("lowest", 0), ("scale", 0), ("ranks", 0), ("planes", 1)):
            known[name] = _with_one_more(known[name], side)
        both = {name: np.stack([np.float32(known[name]), np.float32(own[name])]) for name in own}
        return Blend(**_named(forest, Forest) | both)

    def _network(self, which: int, inputs: int) -> HiddenLayer:
        return HiddenLayer(
            self.lowest[which, :inputs],
            self.scale[which, :inputs],
            self.ranks[which, :inputs],
            np.ascontiguousarray(self.planes[which, :, :inputs]),
            self.bias[which],
            self.weights[which],
            float(self.shift[which]),
        )


def _named(learnt: Forest | HiddenLayer, kind: type[Forest | HiddenLayer]) -> dict[str, Any]:
    return {each.name: getattr(learnt, each.name) for each in fields(kind)}


def _with_one_more(array: Values, side: int) -> Values:
    """Return an array with zeros at the end of an axis."""
    more = [(0, int(axis == side)) for axis in range(array.ndim)]
    return np.pad(array, more)


def _mean(trees: Values, network: Values, weight: Values | float) -> Values:
    mean: Values = trees + np.asarray(weight, np.float32) * (network - trees)
    return mean
