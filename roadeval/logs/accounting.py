"""The account of the frames that were read."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass(slots=True)
class Accounting:
    """Counts of frames and of truth, which grow while frames are read.

    The dictionaries are by frame number, and any thread may add to them.

    Parameters
    ----------
    in_log
        Messages of the image topic.
    in_range
        Those inside the span, before its stride and its limit.
    read
        Frames returned so far.
    labelled
        Of these, those with truth.
    masks
        Of these, those that have a mask of another method, by its name.
    undecodable
        Of the frames returned, those that could not be decoded, and why.
    damaged
        Those that are damaged and were decoded all the same, and what is wrong.
    sizes
        Width and height of those that are not of the topic's size.
    fringes
        By frame number and label topic: pixels ignored because their value is too far from every
        known one, and pixels in all. Only of images that have any.
    truth_unused
        Truth messages between the first and last paired one that belong to no image (counted only
        if every frame is read).
    """

    in_log: int = 0
    in_range: int = 0
    read: int = 0
    labelled: int = 0
    masks: Counter[str] = field(default_factory=Counter)
    undecodable: dict[int, str] = field(default_factory=dict)
    damaged: dict[int, str] = field(default_factory=dict)
    sizes: dict[int, tuple[int, int]] = field(default_factory=dict)
    fringes: dict[tuple[int, str], tuple[int, int]] = field(default_factory=dict)
    truth_unused: int = 0

    @property
    def losses(self) -> tuple[str, ...]:
        """The frames that could not be decoded, or only in part: a sentence each."""
        frames = sorted((self.undecodable | self.damaged).items())
        return tuple(f"frame {number}: {reason}" for number, reason in frames)
