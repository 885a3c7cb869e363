"""Rows of a table as arrays, a column each: what is read and computed with without pandas."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Cells = npt.NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows of a table."""

    columns: Mapping[str, Cells]
    """``(n,)`` each, by name: text, int64 or float64; an undefined number is NaN."""

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __getitem__(self, name: str) -> Cells:
        return self.columns[name]

    def take(self, chosen: Cells | slice) -> Rows:
        """Return the rows at some places, or where a mask of bools holds."""
        return Rows({name: column[chosen] for name, column in self.columns.items()})

    def of_variant(self, name: str) -> Rows:
        """Return the rows of a variant."""
        return self.take(self["variant"] == name)

    def replace(self, **columns: Cells) -> Rows:
        """Return the rows with some columns added, or in place of their own."""
        return Rows({**self.columns, **columns})

    def distinct(self, name: str) -> list[Any]:
        """Return the values of a column, each once, in the order in which they first occur."""
        values, first = np.unique(self[name], return_index=True)
        found: list[Any] = values[np.argsort(first)].tolist()
        return found

    def masks(self) -> Iterator[tuple[str, str, Cells]]:
        """Yield each variant and stage, as they first occur, and the places of their rows."""
        variants, stages = self["variant"], self["stage"]
        left = np.ones(len(self), bool)
        while left.any():
            first = int(left.argmax())
            own = (variants == variants[first]) & (stages == stages[first])
            left &= ~own
            yield str(variants[first]), str(stages[first]), np.flatnonzero(own)


def joined(parts: Sequence[Rows]) -> Rows:
    """Return rows one after the other, with the columns of the first."""
    names = parts[0].columns
    return Rows({name: np.concatenate([part[name] for part in parts]) for name in names})
