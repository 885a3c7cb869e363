"""Which frames of a log train its model: the first ones, or some spread along the drive."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from typing import Protocol

from roadeval.data import Frame
from roadeval.errors import RoadevalError
from roadeval.training.fitting import TrainingError
from roadeval.training.held import HeldFrames
from roadeval.training.settings import TrainingSettings


class Readable(Protocol):
    """A frame of a log that has not been decoded yet."""

    @property
    def number(self) -> int:
        """Position in the image topic."""

    @property
    def labelled(self) -> bool:
        """Whether it has a truth."""

    def decode(self) -> Frame:
        """Decode it; a `RoadevalError` if it cannot be."""


@dataclass(frozen=True, slots=True, eq=False)
class Chosen:
    """The frames that train, and what that means for the others."""

    held: HeldFrames
    """The training frames, decoded."""
    gap: frozenset[int]
    """Numbers of the frames beside them that are not evaluated."""
    first: int | None
    """Number of the first frame to evaluate; None if there is none."""
    undecodable: int = 0
    """How many of the frames chosen do not train, for they cannot be decoded."""


def candidates_of(
    frames: Callable[[], Iterable[Readable]], *, labelled: bool
) -> tuple[Iterator[Readable], bool]:
    """Return the labelled frames and True; if there are none, all frames and False."""
    if labelled:
        with_truth = (frame for frame in frames() if frame.labelled)
        for first in with_truth:
            return chain([first], with_truth), True
    return iter(frames()), False


def from_the_first(
    candidates: Iterator[Readable],
    settings: TrainingSettings,
    on_frame: Callable[[int], None],
    *,
    by_truth: bool,
) -> Chosen:
    """Choose the first ``settings.frames`` frames; the gap lies after them.

    Parameters
    ----------
    candidates
        The frames that may train, in order. Only as many are taken as are needed.
    settings
        How many frames, and the gap.
    on_frame
        Called with the number of training frames decoded so far.
    by_truth
        Whether a frame must be left to evaluate.

    Raises
    ------
    TrainingError
        If none is left, or not one frame can be held in memory.
    """
    gap = settings.gap or 0
    held, rest = _hold(candidates, settings.frames, on_frame)
    following = [readable.number for readable in islice(rest, gap + 1)]
    if by_truth and held.frames and len(following) <= gap:
        raise _none_left(len(held.frames), gap, len(held.frames) + len(following))
    first = following[gap] if len(following) > gap else None
    return Chosen(held, frozenset(following[:gap]), first)


def spread_out(
    candidates: Iterator[Readable],
    settings: TrainingSettings,
    on_frame: Callable[[int], None],
    *,
    by_truth: bool,
) -> Chosen:
    """Choose ``settings.frames`` frames at equal distances; a gap lies on both sides of each.

    Without ``settings.gap`` the gap is a quarter of that distance, and at least one frame. The
    parameters and errors are those of `from_the_first`, but all candidates are taken.
    """
    every = list(candidates)
    asked = frozenset(evenly([each.number for each in every], settings.frames))
    held, _ = _hold((each for each in every if each.number in asked), settings.frames, on_frame)
    trained = {frame.number for frame in held.frames}
    places = [place for place, each in enumerate(every) if each.number in trained]
    gap = settings.gap
    if gap is None:
        gap = max(1, len(every) // max(4 * len(trained), 1))
    near = {place + by for place in places for by in range(-gap, gap + 1)} - {*places}
    left = [each.number for place, each in enumerate(every) if place not in near | {*places}]
    if by_truth and trained and not left:
        raise _none_left(len(trained), len(near & {*range(len(every))}), len(every))
    beside = frozenset(each.number for place, each in enumerate(every) if place in near)
    lost = 0 if held.is_full else len(asked) - len(trained)
    return Chosen(held, beside, left[0] if left else None, lost)


def evenly(numbers: Sequence[int], count: int) -> list[int]:
    """Return ``count`` of the numbers, or all if there are fewer, at equal distances.

    >>> evenly(range(20, 30), 4)
    [20, 22, 25, 27]
    """
    taken = min(count, len(numbers))
    return [numbers[i * len(numbers) // taken] for i in range(taken)]


def decoded(frames: Iterable[Readable]) -> Iterator[tuple[Readable, Frame]]:
    """Decode what can be decoded; a frame that cannot is reported when it is replayed."""
    for readable in frames:
        try:
            frame = readable.decode()
        except RoadevalError:
            continue
        yield readable, frame


def _hold(
    candidates: Iterator[Readable], count: int, on_frame: Callable[[int], None]
) -> tuple[HeldFrames, Iterator[Readable]]:
    """Decode the first ``count`` frames, or as many as can be held; return the others too."""
    held = HeldFrames()
    for readable, frame in decoded(candidates):
        if not held.add(frame):
            if not held.frames:
                raise TrainingError(f"{held.full()}; reduce the frames with `frames.scale`")
            return held, chain([readable], candidates)
        on_frame(len(held.frames))
        if len(held.frames) == count:
            break
    return held, candidates


def _none_left(trained: int, gap: int, total: int) -> TrainingError:
    return TrainingError(
        f"the range has {total} labelled frames, and training would take {trained} of them and "
        f"{gap} more as a gap: none is left to evaluate; lower `training.frames` or "
        "`training.gap`, or give `training.model`"
    )
