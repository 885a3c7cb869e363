"""The data that the report of a fleet is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from roadeval.report.blocks import ImageFile
from roadeval.results.fleet.record import FAILED

Row = Mapping[str, Any]


def page_address(place: int) -> str:
    """Return the address of the page of a drive, by its place in the table of drives."""
    return f"drive/{place}/"


@dataclass(frozen=True, slots=True)
class WorstFrame:
    """One of the worst frames over all drives; without a picture where none is left."""

    rank: int
    drive: str
    frame: int
    rates: Mapping[str, float]
    picture: ImageFile | None


@dataclass(frozen=True, slots=True)
class FleetFindings:
    """The data that the report of a fleet is made of."""

    name: str
    folder: str
    """Of the fleet."""
    summary: Mapping[str, Any]
    """The content of ``fleet.json``."""
    drives: Mapping[str, Row]
    """Rows of ``drives`` by the drives' identity."""
    names: Mapping[str, str]
    """The drives' names for people, by their identity; no two are equal."""
    effects: Mapping[tuple[str, str], Sequence[Row]]
    """Rows of ``effects`` of the final masks' ERR, by base and variant."""
    scores: Sequence[Row]
    """Rows of ``scores`` of the first variant's final mask, over all labelled pixels."""
    worst: Sequence[WorstFrame] = field(default_factory=tuple)
    """The worst frames over all drives."""
    inspect: Callable[[int], str] | None = None
    """Returns the command that opens one of them, by its rank; None where the report is not made at
    a terminal.
    """

    def pages(self) -> dict[str, str]:
        """Return where each drive's own page lies below that of a served fleet.

        By the drives' identity; a drive that failed has none.
        """
        return {
            drive: page_address(place)
            for place, (drive, row) in enumerate(self.drives.items())
            if row["status"] != FAILED
        }
