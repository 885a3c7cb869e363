"""Where a run's model comes from: a file, or the log's own first frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Final, Protocol

from roadeval.config import Variant
from roadeval.data import Frame, Role
from roadeval.errors import RoadevalError
from roadeval.evaluation.baselines import BlindPrior
from roadeval.pipeline import solvers
from roadeval.runtime.processes import elsewhere
from roadeval.training import Model, Plan, TrainingError, TrainingSettings, fit, load_model

BY_PATCH: Final = (
    "the model learnt from the reference patch in front of the vehicle, which is a guess"
)

GREATEST_MEMORY: Final = 2 << 30
"""Bytes that the training frames of a run may take: they are held decoded, all of them."""


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


@dataclass(frozen=True, slots=True)
class Schedule:
    """What each frame of a run is used for.

    Parameters
    ----------
    digests
        Hashes of the frames that trained the model.
    gap
        Numbers of the frames after them that are left out as well.
    first
        Number of the first frame to evaluate, where it is known beforehand.
    sizes
        Bytes that the training frames take as logged, where they are known: a frame of another
        size is none of them, and need not be hashed.
    """

    digests: frozenset[str]
    gap: frozenset[int] = frozenset()
    first: int | None = None
    sizes: frozenset[int] | None = None

    def role(self, frame: Frame) -> Role:
        """Say what a decoded frame is used for."""
        may_be = self.sizes is None or len(frame.payload) in self.sizes
        if may_be and frame.digest() in self.digests:
            return Role.TRAINING
        if frame.number in self.gap:
            return Role.GAP
        return Role.UNLABELLED if frame.truth is None else Role.EVALUATED


@dataclass(slots=True)
class Memory:
    """Counts what the training frames take, so that no number of them fills the machine."""

    frames: int = 0
    taken: int = 0

    def has_room(self, frame: Frame) -> bool:
        """Count a frame that is going to be held, if there is room for it."""
        masks = [frame.truth, frame.shadow_truth, *frame.external.values()]
        # Two filters in a row leave two more images of each frame while a variant is fitted.
        size = 3 * frame.image.nbytes + sum(m.nbytes for m in masks if m is not None)
        size += len(frame.payload)
        if self.taken + size > GREATEST_MEMORY:
            return False
        self.taken += size
        self.frames += 1
        return True

    def hold(self, frame: Frame) -> Frame:
        """Give a frame that is going to be held; a `TrainingError` if it is one too many."""
        if not self.has_room(frame):
            raise TrainingError(f"{self.full()}; lower --train-frames, or --scale the frames")
        return frame

    def full(self) -> str:
        """Say that no more frames can be held."""
        return (
            f"training holds its frames decoded, and more than {self.frames} of them would take "
            f"over {GREATEST_MEMORY >> 20} MiB"
        )


def plans_of(variants: Sequence[Variant]) -> dict[str, Plan]:
    """Give what training needs to know of each variant, by name."""
    return {v.name: Plan(v.pipeline.chain, v.pipeline.settings) for v in variants}


def from_file(path: Path, variants: Sequence[Variant]) -> tuple[Model, Schedule]:
    """Read a model file and make sure that it was made for these variants.

    Whether what it learnt fits their settings turns out when they are bound.
    """
    model = load_model(path)
    for name, plan in plans_of(variants).items():
        model.require(name, plan, path)
    return model, Schedule(model.digests)


@elsewhere(solvers)
def from_log(
    frames: Callable[[], Iterable[Readable]],
    variants: Sequence[Variant],
    settings: TrainingSettings,
    on_frame: Callable[[int], None],
    *,
    labelled: bool,
) -> tuple[Model, Schedule]:
    """Train on the first frames of a log.

    Parameters
    ----------
    frames
        Gives the frames of the selected range, in order and from the first at each call. Only as
        many are decoded as are needed.
    variants
        What to train.
    settings
        How many frames, and the rest.
    on_frame
        Called with the number of training frames decoded so far.
    labelled
        Whether the log's truth may teach; then only frames that have one train, and some must
        be left to evaluate. Where no frame of the range has one, the first ones train.

    Raises
    ------
    TrainingError
        If there is nothing to learn from, or nothing left to evaluate.
    """
    wanted, by_truth = _teachers(frames, labelled=labelled)
    chosen: list[Frame] = []
    memory = Memory()
    short = ""
    # The rest begins at the frame after the last that is taken.
    for readable, frame in _decoded(wanted):
        if not memory.has_room(frame):
            wanted, short = chain([readable], wanted), memory.full()
            if not chosen:
                raise TrainingError(f"{short}; reduce the frames with --scale")
            break
        chosen.append(frame)
        on_frame(len(chosen))
        if len(chosen) == settings.frames:
            break
    rest = list(zip(range(settings.gap + 1), wanted, strict=False))
    if by_truth and chosen and len(rest) <= settings.gap:
        raise TrainingError(
            f"the range has {len(chosen) + len(rest)} labelled frames, and training would take "
            f"{len(chosen)} of them and {settings.gap} more as a gap: none is left to evaluate; "
            "lower --train-frames or --train-gap, or give --model"
        )
    numbers = [readable.number for _, readable in rest]
    model = train_on(chosen, plans_of(variants), settings)
    if labelled and not by_truth:
        model = _told(model, f"no frame of the range has road truth: {BY_PATCH}")
    if short:
        model = _told(model, f"trained on {len(chosen)} of {settings.frames} frames: {short}")
    first = numbers[settings.gap] if len(numbers) > settings.gap else None
    gap, sizes = frozenset(numbers[: settings.gap]), frozenset(len(f.payload) for f in chosen)
    return model, Schedule(model.digests, gap, first, sizes)


def _teachers(
    frames: Callable[[], Iterable[Readable]], *, labelled: bool
) -> tuple[Iterator[Readable], bool]:
    """Give the frames that may train, and whether by their truth: all, where none has one."""
    if labelled:
        wanted = (frame for frame in frames() if frame.labelled)
        for first in wanted:
            return chain([first], wanted), True
    return iter(frames()), False


@elsewhere(solvers)
def from_drives(
    frames: Mapping[Path, Sequence[Frame]], variants: Sequence[Variant], settings: TrainingSettings
) -> Model:
    """Train on frames of some drives, by the drives' paths.

    Raises
    ------
    TrainingError
        If some drives have truth and others have none, or none has although the settings insist
        on it, or there is nothing to learn from.
    """
    bare = [path for path, own in frames.items() if not any(f.truth is not None for f in own)]
    insists = settings.source == "truth" or len(bare) < len(frames)
    if bare and insists and settings.source != "patch":
        raise TrainingError(
            f"{bare[0]}: no road truth to train on in the range; name its topic with "
            '--truth-topic, leave the drive out, or set training.source = "patch"'
        )
    every = [frame for own in frames.values() for frame in own]
    model = train_on(every, plans_of(variants), settings)
    if bare and settings.source == "auto":
        model = _told(model, f"no drive has road truth in the range: {BY_PATCH}")
    return model


def _told(model: Model, warning: str) -> Model:
    return replace(model, warnings=(warning, *model.warnings))


def train_on(
    frames: Sequence[Frame], plans: Mapping[str, Plan], settings: TrainingSettings
) -> Model:
    """Train on decoded frames; their truths, where they have any, make the baseline."""
    truths = [frame.truth for frame in frames if frame.truth is not None]
    prior = BlindPrior.of_truths(truths).road if truths else None
    return fit(frames, plans, settings, prior)


def _decoded(frames: Iterator[Readable]) -> Iterator[tuple[Readable, Frame]]:
    """Decode what can be decoded; a frame that cannot is reported when it is replayed."""
    for readable in frames:
        try:
            frame = readable.decode()
        except RoadevalError:
            continue
        yield readable, frame


def spread(
    frames: Callable[[], Iterable[Readable]], count: int, *, labelled: bool
) -> Iterator[Frame]:
    """Decode ``count`` frames, spread evenly over those that there are.

    Parameters
    ----------
    frames
        Begins anew at each call: once to see which there are, once to read them.
    count
        At most so many.
    labelled
        Take labelled ones alone, if there is any.
    """
    seen = {frame.number: frame.labelled for frame in frames()}
    numbers = [number for number, has_truth in seen.items() if has_truth and labelled] or [*seen]
    taken = min(count, len(numbers))
    chosen = frozenset(numbers[i * len(numbers) // taken] for i in range(taken))
    for _, frame in _decoded(each for each in frames() if each.number in chosen):
        yield frame
