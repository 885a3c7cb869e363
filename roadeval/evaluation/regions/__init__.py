"""The regions: sets of pixels that are counted apart, to show where the errors are.

To add one, add a file with ``REGIONS``: each becomes rows of ``regions.csv`` and of the report.
"""

from __future__ import annotations

import sys
from collections.abc import Collection
from itertools import chain
from typing import Final

from roadeval.data.arrays import Bits
from roadeval.evaluation.region import LabelledFrame, Region
from roadeval.runtime.discovery import collect

ALL: Final = "all"
"""The name of the whole frame in sums by region."""
HALVES: Final = ("boundary", "interior")
"""Regions that together are the whole frame."""
REGIONS: Final[tuple[Region, ...]] = tuple(
    sorted(chain(*collect(sys.modules[__name__], "REGIONS")), key=lambda region: region.order)
)


def of_frame(labelled: LabelledFrame) -> dict[str, Bits]:
    """Compute every region of a labelled frame, ``(H, words)`` each, by name."""
    return {name: bits for region in REGIONS for name, bits in region.find(labelled).items()}


def titles(names: Collection[str], height: int = 0) -> dict[str, str]:
    """Return the titles of some regions for people, in order.

    The title of a region that no file defines is its name. ``height`` is the height of the images
    in pixels, or 0 if it is not known.
    """
    defined = {n: title for r in REGIONS for n, title in r.titles_of(names, height).items()}
    return defined | {name: name.replace("_", " ") for name in names if name not in defined}
