"""A decision for every colour there is: 2^24 bits, so that a pixel's is looked up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Mask
from roadeval.kernels import KERNELS
from roadeval.kernels.arrays import Words
from roadeval.kernels.packing import ones
from roadeval.pipeline.colour import Planes
from roadeval.pipeline.cube import Slabs

Colours = npt.NDArray[np.uint8]
Decide = Callable[[Colours], npt.NDArray[np.bool_]]

UNDECIDED: Final = 2
"""What the kernel gives for a colour that is still open."""
FEW: Final = 1 << 16
"""Open colours that are decided at once, so that nobody need look for them again."""


class ColourTable:
    """Which colours have a positive margin, each decided as exactly as `decide` says it.

    Parameters
    ----------
    margins
        The margin of every colour. Where its error bound keeps it off 0 it decides.
    decide
        From ``(n, 3)`` uint8 colours to ``(n,)`` bool, for the colours that are left. Mostly these
        are some twenty; but where a machine has learnt nothing and its margin is 0 everywhere,
        they are all colours, and only those are decided that are looked up.
    """

    def __init__(self, margins: Slabs, decide: Decide) -> None:
        self._decide = decide
        self._words = _table(margins)
        if 0 < ones(self._words[1]) <= FEW:
            bits = np.unpackbits(self._words[1].view(np.uint8), bitorder="little")
            road, _ = self._decided(_colours(np.flatnonzero(bits)))
            self._words = road, np.zeros(0, np.uint64)
        elif not self._words[1].any():
            self._words = self._words[0], np.zeros(0, np.uint64)

    def look_up(self, planes: Planes) -> Mask:
        """Give ``(H, W)`` uint8, 1 where a pixel's margin is positive; from any thread."""
        mask: Mask = KERNELS.look_up_colours(planes, *self._words)
        if len(self._words[1]):
            seen = mask == UNDECIDED
            if seen.any():
                colours = np.stack([plane[seen] for plane in planes], axis=1)
                # In new words, for others look up in the ones there are. Of two threads that come
                # here together the later one's are kept, and the other's colours asked for again.
                self._words = words = self._decided(np.unique(colours, axis=0))
                mask = KERNELS.look_up_colours(planes, *words)
        return mask

    def _decided(self, colours: Colours) -> tuple[Words, Words]:
        """Give the words in which these ``(n, 3)`` colours are decided too."""
        road, left = (words.copy() for words in self._words)
        word, bit = _places(colours)
        np.bitwise_or.at(road, word, np.where(self._decide(colours), bit, np.uint64(0)))
        np.bitwise_and.at(left, word, ~bit)
        return road, left


def _table(margins: Slabs) -> tuple[Words, Words]:
    """Make the words of the colours that are road for certain, and of those that are open."""
    words = np.empty((2, 64, 64 * 64), np.uint64)
    block = np.empty((2, 64, 64, 4, 4, 4), np.bool_)
    for red, margin in enumerate(margins):
        for here, slab in zip(
            block, (margin > margins.error, np.abs(margin) <= margins.error), strict=True
        ):
            here[:, :, red & 3] = slab.reshape(64, 4, 64, 4).transpose(0, 2, 1, 3)
        if red & 3 == 3:
            bits = np.packbits(block.reshape(2, -1), axis=1, bitorder="little")
            words[:, red >> 2] = bits.view(np.uint64)
    road, left = words.reshape(2, -1)
    return road, left


def _places(colours: Colours) -> tuple[npt.NDArray[np.int64], Words]:
    """Word, and bit in it, of ``(n, 3)`` colours; see `roadeval.kernels.plain.look_up_colours`."""
    r, g, b = colours.T.astype(np.int64)
    bit = (r & 3) << 4 | (g & 3) << 2 | b & 3
    return (r >> 2) << 12 | (g >> 2) << 6 | b >> 2, np.uint64(1) << bit.astype(np.uint64)


def _colours(places: npt.NDArray[np.intp]) -> Colours:
    """Give the ``(n, 3)`` colours of places: word times 64 and bit, the reverse of `_places`."""
    coarse = places >> 18, places >> 12 & 63, places >> 6 & 63
    fine = places >> 4 & 3, places >> 2 & 3, places & 3
    return np.stack([c << 2 | f for c, f in zip(coarse, fine, strict=True)], axis=1).astype(
        np.uint8
    )
