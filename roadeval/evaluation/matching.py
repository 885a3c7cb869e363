"""The masks that two results of a drive have in common, frame by frame."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from roadeval.data import Rows


@dataclass(frozen=True, slots=True, eq=False)
class CommonMask:
    """A mask's rows in two results, on the frames that both have, in the base's order.

    ``keys`` are the frames' stamps, each with its place among equal ones.
    """

    variant: str
    stage: str
    begins: int
    keys: list[tuple[int, int]]
    before: Rows
    after: Rows

    @property
    def truth_differs(self) -> npt.NDArray[np.bool_]:
        """Where the truth's road or labelled pixels differ, ``(n,)``."""
        before, after = self.before, self.after
        road = before["TP"] + before["FN"] != after["TP"] + after["FN"]
        return np.asarray(road | (before["N"] != after["N"]))


def common_masks(base: Rows, new: Rows, variant: str | None) -> list[CommonMask]:
    """Match the masks of two results, and their frames by stamp; in the base's order.

    With ``variant`` the base's masks are taken for this variant's.
    """
    others = {(name, stage): places for name, stage, places in new.masks()}
    found = []
    for name, stage, places in base.masks():
        other = others.get((variant or name, stage))
        if other is None:
            continue
        theirs = dict(zip(_keys(new.take(other)), other.tolist(), strict=True))
        mine = dict(zip(_keys(base.take(places)), places.tolist(), strict=True))
        both = [key for key in mine if key in theirs]
        if both:
            before = [mine[key] for key in both]
            after = np.array([theirs[key] for key in both])
            rows = base.take(np.array(before)), new.take(after)
            found.append(CommonMask(variant or name, stage, before[0], both, *rows))
    return sorted(found, key=lambda mask: mask.begins)


def _keys(mask: Rows) -> list[tuple[int, int]]:
    """Return the stamps of a mask's rows; equal stamps are told apart by their order."""
    seen: Counter[int] = Counter()
    keys = []
    for stamp in mask["stamp_ns"].tolist():
        keys.append((stamp, seen[stamp]))
        seen[stamp] += 1
    return keys
