"""Where a run's model comes from: a file, or the log's own first frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from roadeval.config import Variant
from roadeval.data import Frame, Role
from roadeval.errors import RoadevalError
from roadeval.evaluation.baselines import BlindPrior
from roadeval.training import Model, Plan, TrainingError, TrainingSettings, fit, load_model


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
    """

    digests: frozenset[str]
    gap: frozenset[int] = frozenset()
    first: int | None = None

    def role(self, frame: Frame) -> Role:
        """Say what a decoded frame is used for."""
        if frame.digest() in self.digests:
            return Role.TRAINING
        if frame.number in self.gap:
            return Role.GAP
        return Role.UNLABELLED if frame.truth is None else Role.EVALUATED


def plans_of(variants: Sequence[Variant]) -> dict[str, Plan]:
    """Give what training needs to know of each variant, by name."""
    return {variant.name: variant.config.plan() for variant in variants}


def from_file(path: Path, variants: Sequence[Variant]) -> tuple[Model, Schedule]:
    """Read a model file and make sure that it was made for these variants."""
    model = load_model(path)
    for name, plan in plans_of(variants).items():
        model.require(name, plan.relevant(), path)
    return model, Schedule(model.digests)


def from_log(
    frames: Iterable[Readable],
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
        The frames of the selected range, in order. Only as many are decoded as are needed.
    variants
        What to train.
    settings
        How many frames, and the rest.
    on_frame
        Called with the number of training frames decoded so far.
    labelled
        Whether the log has a truth; then only frames that have one train, and some must be
        left to evaluate.

    Raises
    ------
    TrainingError
        If there is nothing to learn from, or nothing left to evaluate.
    """
    wanted = (f for f in frames if f.labelled) if labelled else iter(frames)
    chosen: list[Frame] = []
    for frame in _decoded(wanted):
        chosen.append(frame)
        on_frame(len(chosen))
        if len(chosen) == settings.frames:
            break
    rest = list(zip(range(settings.gap + 1), wanted, strict=False))
    if labelled and chosen and len(rest) <= settings.gap:
        raise TrainingError(
            f"the range has {len(chosen) + len(rest)} labelled frames, and training would take "
            f"{len(chosen)} of them and {settings.gap} more as a gap: none is left to evaluate; "
            "lower --train-frames or --train-gap, or give --model"
        )
    numbers = [readable.number for _, readable in rest]
    model = train_on(chosen, plans_of(variants), settings)
    first = numbers[settings.gap] if len(numbers) > settings.gap else None
    return model, Schedule(model.digests, frozenset(numbers[: settings.gap]), first)


def train_on(
    frames: Sequence[Frame], plans: Mapping[str, Plan], settings: TrainingSettings
) -> Model:
    """Train on decoded frames; their truths, where they have any, make the baseline."""
    truths = [frame.truth for frame in frames if frame.truth is not None]
    prior = BlindPrior.of_truths(truths).road if truths else None
    return fit(frames, plans, settings, prior)


def _decoded(frames: Iterator[Readable]) -> Iterator[Frame]:
    """Decode what can be decoded; a frame that cannot is reported when it is replayed."""
    for readable in frames:
        with suppress(RoadevalError):
            yield readable.decode()


def spread(frames: Callable[[], Iterable[Readable]], count: int) -> Iterator[Frame]:
    """Decode ``count`` labelled frames, spread evenly over those that there are.

    ``frames`` begins anew at each call: once to see which are labelled, once to read them.
    """
    numbers = [frame.number for frame in frames() if frame.labelled]
    taken = min(count, len(numbers))
    chosen = frozenset(numbers[i * len(numbers) // taken] for i in range(taken))
    yield from _decoded(frame for frame in frames() if frame.number in chosen)
