"""The regions: sets of pixels that are counted separately, to show where the errors are.

To add regions, add a file with ``REGIONS``; ``regions.csv`` and the report then have their rows.
Another package adds one by an entry point of the group ``roadeval.regions``.
"""

from __future__ import annotations

import sys
from collections.abc import Collection
from functools import cache
from itertools import chain
from typing import Final

from roadeval.data.arrays import Bits
from roadeval.errors import RoadevalError
from roadeval.evaluation.region import LabelledFrame, Region
from roadeval.runtime.discovery import collect, installed

ALL: Final = "all"
"""The name of the whole frame in tables by region."""
HALVES: Final = ("boundary", "interior")
"""Regions that together are the whole frame."""


@cache
def regions() -> tuple[Region, ...]:
    """Return the regions in their order, with the regions of other packages."""
    built_in = chain(*collect(sys.modules[__name__], "REGIONS"))
    others = installed("regions", Region, RoadevalError)
    return tuple(sorted([*built_in, *others], key=lambda region: region.order))


def of_frame(labelled: LabelledFrame) -> dict[str, Bits]:
    """Compute every region of a labelled frame, ``(H, words)`` each, by name.

    A `RoadevalError` if two regions have the same name.
    """
    parts = [region.find(labelled) for region in regions()]
    by_name = {name: bits for part in parts for name, bits in part.items()}
    if len(by_name) < sum(map(len, parts)):
        raise RoadevalError("two regions have the same name", remedy="rename one of them")
    return by_name


def titles(names: Collection[str], height: int = 0) -> dict[str, str]:
    """Return the titles of some regions for people, in order.

    A region that no file defines has its name as its title. ``height`` is the height of the images
    in pixels, or 0 if it is not known.
    """
    defined = {n: title for r in regions() for n, title in r.titles_of(names, height).items()}
    return defined | {name: name.replace("_", " ") for name in names if name not in defined}
