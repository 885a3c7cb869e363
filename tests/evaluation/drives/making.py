"""Drives that tests make up."""

from __future__ import annotations

from collections.abc import Sequence

from roadeval.evaluation.drives import DriveEffect


def drives(
    means: Sequence[float],
    groups: Sequence[str] | None = None,
    counts: Sequence[tuple[int, int, int, int] | None] | None = None,
) -> list[DriveEffect]:
    """Return drives ``000``, ``001`` ...; counts are both of the base, then both of the new."""
    made = []
    for place, mean in enumerate(means):
        name = f"{place:03}"
        own = None if counts is None else counts[place]
        made.append(
            DriveEffect(
                *(name, name if groups is None else groups[place], mean, 100),
                *((None, None) if own is None else (own[:2], own[2:])),
            )
        )
    return made
