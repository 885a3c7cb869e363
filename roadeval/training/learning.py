"""Where a run's model comes from: a file, the log's own first frames, or frames of other drives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path
from typing import Final, Protocol

from roadeval.data import Frame
from roadeval.errors import RoadevalError
from roadeval.evaluation.baselines import BlindPrior
from roadeval.pipeline.chain import Pipeline
from roadeval.training.fitting import TrainingError, fit
from roadeval.training.held import HeldFrames
from roadeval.training.likeness import Likeness
from roadeval.training.model import Model, kept_model
from roadeval.training.schedule import Schedule
from roadeval.training.settings import TrainingSettings

BY_PATCH: Final = (
    "the model learnt from the reference patch in front of the vehicle, which is a guess"
)


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


def from_file(path: Path, pipelines: Mapping[str, Pipeline]) -> tuple[Model, Schedule]:
    """Read a model file and check that it was made for these variants.

    Whether what it learnt fits their settings turns out when they are bound.
    """
    model = kept_model(path)
    for name, pipeline in pipelines.items():
        model.require(name, pipeline, path)
    known = None if model.fingerprints is None else Likeness(model.fingerprints)
    return model, Schedule(model.digests, likeness=known)


def from_log(
    frames: Callable[[], Iterable[Readable]],
    pipelines: Mapping[str, Pipeline],
    settings: TrainingSettings,
    on_frame: Callable[[int], None],
    *,
    labelled: bool,
) -> tuple[tuple[Model, ...], Schedule]:
    """Train on the first frames of a log, with each seed of the settings.

    Parameters
    ----------
    frames
        Returns the frames of the selected range, in order and from the first at each call. Only as
        many are decoded as are needed.
    pipelines
        What to train, by variant.
    settings
        How many frames, and the rest.
    on_frame
        Called with the number of training frames decoded so far.
    labelled
        Whether the log's truth may be used; then only frames that have one train, and some must
        be left to evaluate. Where no frame of the range has one, the first ones train.

    Returns
    -------
    models, schedule
        The model of each seed, the first with the warnings of all, and which frames are left out.

    Raises
    ------
    TrainingError
        If there is nothing to learn from, or nothing left to evaluate.
    """
    candidates, by_truth = _candidates(frames, labelled=labelled)
    if not by_truth and not any(pipeline.learning() for pipeline in pipelines.values()):
        return (untrained(pipelines),), Schedule(frozenset())
    held, rest = _hold(candidates, settings.frames, on_frame)
    following = [readable.number for readable in islice(rest, settings.gap + 1)]
    if by_truth:
        _require_one_left(len(held.frames), len(following), settings.gap)
    warnings = []
    if held.is_full:
        warnings.append(f"trained on {len(held.frames)} of {settings.frames} frames: {held.full()}")
    warnings += _repeated(held.frames)
    if labelled and not by_truth:
        warnings.append(f"no frame of the range has road truth: {BY_PATCH}")
    models = _with_each_seed(held.frames, pipelines, settings, warnings)
    return models, Schedule(
        models[0].digests,
        gap=frozenset(following[: settings.gap]),
        first=following[settings.gap] if len(following) > settings.gap else None,
        sizes=frozenset(len(frame.payload) for frame in held.frames),
    )


def untrained(pipelines: Mapping[str, Pipeline]) -> Model:
    """Return the model of variants that learn nothing, without a truth for the baseline."""
    settings = {name: pipeline.relevant() for name, pipeline in pipelines.items()}
    return Model({name: {} for name in pipelines}, settings, "none", frozenset(), 0)


def _with_each_seed(
    frames: Sequence[Frame],
    pipelines: Mapping[str, Pipeline],
    settings: TrainingSettings,
    warnings: Sequence[str],
) -> tuple[Model, ...]:
    """Train once a seed; the first model tells what any of the trainings warns of."""
    first, *others = (train_on(frames, pipelines, each) for each in settings.by_seed())
    told = [
        f"seed {seed}: {warning}"
        for seed, model in enumerate(others, settings.seed + 1)
        for warning in model.warnings
    ]
    return replace(first, warnings=(*warnings, *first.warnings, *told)), *others


def _candidates(
    frames: Callable[[], Iterable[Readable]], *, labelled: bool
) -> tuple[Iterator[Readable], bool]:
    """Return the frames that may train, and whether by their truth: all, where none has one."""
    if labelled:
        with_truth = (frame for frame in frames() if frame.labelled)
        for first in with_truth:
            return chain([first], with_truth), True
    return iter(frames()), False


def _hold(
    candidates: Iterator[Readable], count: int, on_frame: Callable[[int], None]
) -> tuple[HeldFrames, Iterator[Readable]]:
    """Decode the first ``count`` frames, or as many as can be held; return the others too."""
    held = HeldFrames()
    for readable, frame in _decoded(candidates):
        if not held.add(frame):
            if not held.frames:
                raise TrainingError(f"{held.full()}; reduce the frames with `frames.scale`")
            return held, chain([readable], candidates)
        on_frame(len(held.frames))
        if len(held.frames) == count:
            break
    return held, candidates


def _decoded(frames: Iterable[Readable]) -> Iterator[tuple[Readable, Frame]]:
    """Decode what can be decoded; a frame that cannot is reported when it is replayed."""
    for readable in frames:
        try:
            frame = readable.decode()
        except RoadevalError:
            continue
        yield readable, frame


def _require_one_left(trained: int, following: int, gap: int) -> None:
    """Raise a `TrainingError` if training and the gap after it leave no frame to evaluate."""
    if trained and following <= gap:
        raise TrainingError(
            f"the range has {trained + following} labelled frames, and training would take "
            f"{trained} of them and {gap} more as a gap: none is left to evaluate; "
            "lower `training.frames` or `training.gap`, or give `training.model`"
        )


def from_drives(
    frames: Mapping[Path, Sequence[Frame]],
    pipelines: Mapping[str, Pipeline],
    settings: TrainingSettings,
    warnings: Sequence[str] = (),
) -> Model:
    """Train on frames of some drives, by the drives' paths.

    ``warnings`` are put before those of the training itself.

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
            'topics.truth, leave the drive out, or set training.source = "patch"'
        )
    guessed = bare and settings.source == "auto"
    guess = [f"no drive has road truth in the range: {BY_PATCH}"] if guessed else []
    repeated = [told for path, own in frames.items() for told in _repeated(own, f"{path.name}: ")]
    every = [frame for own in frames.values() for frame in own]
    return train_on(every, pipelines, settings, [*warnings, *repeated, *guess])


def train_on(
    frames: Sequence[Frame],
    pipelines: Mapping[str, Pipeline],
    settings: TrainingSettings,
    warnings: Sequence[str] = (),
) -> Model:
    """Train on decoded frames; their truths, where they have any, make the baseline.

    ``warnings`` are put before those of the training itself.
    """
    truths = [frame.truth for frame in frames if frame.truth is not None]
    prior = BlindPrior.of_truths(truths).road if truths else None
    model = fit(frames, pipelines, settings, prior)
    return replace(model, warnings=(*warnings, *model.warnings))


def _repeated(frames: Sequence[Frame], drive: str = "") -> list[str]:
    """Tell that some training frames of a drive show the same image as others, if they do."""
    repeated = len(frames) - len({frame.digest() for frame in frames})
    if not repeated:
        return []
    return [
        f"{drive}{repeated} of the {len(frames)} training frames repeat another one: the model "
        "learnt from fewer than was asked for"
    ]


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
