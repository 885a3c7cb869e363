"""A decision for every colour there is: 2^24 bits, so that a pixel's is looked up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Mask
from roadeval.data.arrays import Words
from roadeval.data.packed import ones
from roadeval.kernels import KERNELS
from roadeval.pipeline.cube import Slabs
from roadeval.pipeline.paper.hsi import Planes

Colours = npt.NDArray[np.uint8]
Decide = Callable[[Colours], npt.NDArray[np.bool_]]

UNDECIDED: Final = 2
"""What the kernel gives for a colour that is still open."""
FEW: Final = 1 << 16
"""Open colours that are decided at once, so that nobody need look for them again."""
_NONE: Final = np.zeros(0, np.uint64)


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
        self._words = road, left = _table(margins)
        if not left.any():
            self._words = road.copy(), _NONE
        elif ones(left) <= FEW:
            bits = np.unpackbits(left.view(np.uint8), bitorder="little")
            road, _ = self._decided(self._words, np.flatnonzero(bits))
            self._words = road, _NONE

    def look_up(self, planes: Planes) -> Mask:
        """Give ``(H, W)`` uint8, 1 where a pixel's margin is positive; from any thread."""
        words = self._words
        mask: Mask = KERNELS.look_up_colours(planes, *words)
        if len(words[1]):
            seen = mask == UNDECIDED
            if seen.any():
                places = np.unique(_places(*(plane[seen] for plane in planes)))
                # In new words, for others look up in the ones there are. Of two threads that come
                # here together the later one's are kept, and the other's colours asked for again.
                self._words = words = self._decided(words, places)
                mask = KERNELS.look_up_colours(planes, *words)
        return mask

    def _decided(
        self, words: tuple[Words, Words], places: npt.NDArray[np.int64]
    ) -> tuple[Words, Words]:
        """Give words in which the colours of ``(n,)`` places are decided too."""
        road, left = (each.copy() for each in words)
        word, bit = places >> 6, np.uint64(1) << (places & 63).astype(np.uint64)
        np.bitwise_or.at(road, word, np.where(self._decide(_colours(places)), bit, np.uint64(0)))
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


def _places(*colours: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """Place of ``(n,)`` red, green and blue: the word times 64, and the bit in it.

    See `roadeval.kernels.plain.look_up_colours`.
    """
    r, g, b = (channel.astype(np.int64) for channel in colours)
    coarse = (r >> 2) << 12 | (g >> 2) << 6 | b >> 2
    return coarse << 6 | (r & 3) << 4 | (g & 3) << 2 | b & 3


def _colours(places: npt.NDArray[np.int64]) -> Colours:
    """Give the ``(n, 3)`` colours of ``(n,)`` places."""
    coarse = places >> 18, places >> 12 & 63, places >> 6 & 63
    fine = places >> 4 & 3, places >> 2 & 3, places & 3
    channels = [c << 2 | f for c, f in zip(coarse, fine, strict=True)]
    return np.stack(channels, axis=1).astype(np.uint8)
