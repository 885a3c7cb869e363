"""Drives dealt into folds: each is scored by a model that learnt from the others."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping

from roadeval.fleet.errors import FleetError


def deal(groups: Mapping[str, str], folds: int, seed: int) -> dict[str, int]:
    """Deal drives into folds; those of a group stay together.

    The groups are shuffled by the digest of seed and name, which depends neither on their order
    nor on the other groups', and dealt like cards, so that the folds' numbers of groups differ by
    one at most.

    Parameters
    ----------
    groups
        The group of each drive; one that stands alone is its own.
    folds
        2 at least.
    seed
        Of the shuffle.

    Returns
    -------
    dict
        The fold of each drive, from 0.

    Raises
    ------
    FleetError
        If there are fewer groups than folds.

    Examples
    --------
    >>> deal({"a": "monday", "b": "monday", "c": "tuesday"}, 2, seed=0)
    {'a': 1, 'b': 1, 'c': 0}
    """
    names = shuffled(set(groups.values()), seed)
    if len(names) < folds:
        raise FleetError(
            f"`fleet.folds`: {folds} folds need as many drives with truth, or groups of them, "
            f"and there are {len(names)} (copies of one log count as one)"
        )
    fold = {name: place % folds for place, name in enumerate(names)}
    return {drive: fold[group] for drive, group in groups.items()}


def shuffled(names: Iterable[str], seed: int) -> list[str]:
    """Return names in an order that the seed draws, whatever order they came in."""

    def drawn(name: str) -> bytes:
        return hashlib.blake2b(f"{seed} {name}".encode("utf-8", "surrogateescape")).digest()

    return sorted(names, key=drawn)
