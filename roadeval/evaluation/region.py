"""Regions: sets of pixels counted separately, found in every labelled frame."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from roadeval.data import Frame, TruthBits, VariantResult
from roadeval.data.arrays import Bits
from roadeval.evaluation.settings import EvaluationSettings

Titles = Callable[[Collection[str], int], Mapping[str, str]]
"""Returns the titles of those of some names that it knows, in order; see `RegionFamily`."""


def fixed(titles: Mapping[str, str]) -> Titles:
    """Return what picks from titles that are always the same."""
    return lambda names, _height: {name: titles[name] for name in titles if name in names}


@dataclass(frozen=True, slots=True, eq=False)
class LabelledFrame:
    """The input of a region: a frame, its packed truth, and what the variants made of it."""

    frame: Frame
    truth: TruthBits
    variants: tuple[VariantResult, ...]
    settings: EvaluationSettings


@dataclass(frozen=True, slots=True)
class Region:
    """A region."""

    name: str
    """As ``true_shadow``, in the column ``region`` of ``regions.csv``."""
    title: str
    """A few words for a person, as ``inside true shadow``."""
    order: int
    """Its place among the regions."""
    find: Callable[[LabelledFrame], Bits | None]
    """Computes the region, ``(H, words)``; None where the frame has none."""

    def found(self, labelled: LabelledFrame) -> Mapping[str, Bits]:
        """Return the region by its name, or nothing."""
        bits = self.find(labelled)
        return {} if bits is None else {self.name: bits}

    @property
    def titles(self) -> Titles:
        """See `RegionFamily`."""
        return fixed({self.name: self.title})


@dataclass(frozen=True, slots=True)
class RegionFamily:
    """Regions that are found together."""

    order: int
    """Their place among the regions."""
    found: Callable[[LabelledFrame], Mapping[str, Bits]]
    """Computes the regions, ``(H, words)`` each, by name."""
    titles: Titles
    """Returns the titles of those of some names that belong to the family, in order. The second
    argument is the images' height in pixels, 0 if it is not known.
    """
    whole: bool = False
    """Whether the regions, none of which overlap, together are the whole frame: the counts are
    checked against that.
    """
