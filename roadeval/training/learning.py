"""Where a run's model comes from: a file, the log's own frames, or frames of other drives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from roadeval.data import Frame
from roadeval.evaluation.score import BlindPrior
from roadeval.pipeline.chain import Pipeline
from roadeval.training.choice import (
    Readable,
    candidates_of,
    decoded,
    evenly,
    from_the_first,
    spread_out,
)
from roadeval.training.fitting import TrainingError, fit
from roadeval.training.likeness import Likeness
from roadeval.training.model import Model, kept_model
from roadeval.training.schedule import Schedule
from roadeval.training.settings import TrainingSettings

BY_PATCH: Final = (
    "the model learnt from the reference patch in front of the vehicle, which is a guess"
)


def from_file(path: Path, pipelines: Mapping[str, Pipeline]) -> tuple[Model, Schedule]:
    """Read a model file and check that it was made for these variants.

    Whether what it learnt fits their settings turns out when they are bound.
    """
    stages = (stage for pipeline in pipelines.values() for stage in pipeline.stages())
    model = kept_model(path, tuple(dict.fromkeys(stages)))
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
    base: Model | None = None,
) -> tuple[tuple[Model, ...], Schedule]:
    """Train on some frames of a log, with each seed of the settings.

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
    base
        What was learnt from other drives, on top of which to learn.

    Returns
    -------
    models, schedule
        The model of each seed, the first with the warnings of all, and which frames are left out.

    Raises
    ------
    TrainingError
        If there is nothing to learn from, or nothing left to evaluate.
    """
    if base is not None:
        _require_adaptable(pipelines)
    candidates, by_truth = candidates_of(frames, labelled=labelled)
    if base is not None and not by_truth and settings.source != "patch":
        raise TrainingError(
            "no frame of the range has road truth to adapt the model to, and what the reference "
            "patch guesses may make it worse: leave `training.adapt` out, or insist with "
            'training.source = "patch"'
        )
    if not by_truth and not any(pipeline.learning() for pipeline in pipelines.values()):
        return (untrained(pipelines),), Schedule(frozenset())
    choose = spread_out if settings.placement == "spread" else from_the_first
    chosen = choose(candidates, settings, on_frame, by_truth=by_truth)
    held = chosen.held
    warnings = []
    if held.is_full:
        warnings.append(f"trained on {len(held.frames)} of {settings.frames} frames: {held.full()}")
    if chosen.undecodable:
        warnings.append(
            f"trained on {len(held.frames)} frames: {chosen.undecodable} more of those at equal "
            "distances cannot be decoded"
        )
    warnings += _repeated(held.frames)
    if labelled and not by_truth:
        warnings.append(f"no frame of the range has road truth: {BY_PATCH}")
    if base is not None:
        warnings.append(adapted(settings, len(held.frames), by_truth=by_truth))
    models = _with_each_seed(held.frames, pipelines, settings, warnings, base)
    sizes = frozenset(len(frame.payload) for frame in held.frames)
    schedule = Schedule(models[0].digests, gap=chosen.gap, first=chosen.first, sizes=sizes)
    if base is not None:  # frames that it has learnt from may be of any size, and encoded anew
        known = None if base.fingerprints is None else Likeness(base.fingerprints)
        schedule = replace(schedule, sizes=None, likeness=known)
    return models, schedule


def _require_adaptable(pipelines: Mapping[str, Pipeline]) -> None:
    """Raise a `TrainingError` for a variant that learns, and cannot learn further."""
    for name, pipeline in pipelines.items():
        learning = [stage for stage in pipeline.stages() if stage.fit is not None]
        if learning and not any(stage.adapt for stage in learning):
            stages = ", ".join(stage.name for stage in learning)
            raise TrainingError(
                f"variant {name}: no stage of it can learn further ({stages}); use preset robust, "
                "or leave `training.adapt` out"
            )


def adapted(settings: TrainingSettings, frames: int, *, by_truth: bool) -> str:
    """Return the sentence that sets an adapted model apart from one of other drives alone."""
    how = "labelled frames" if by_truth else "frames, by the reference patch in them,"
    return (
        f"the model of other drives ({settings.model}) was adapted to this drive with {frames} of "
        f"its own {how}: the rates are not those on a drive that it has not seen"
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
    base: Model | None,
) -> tuple[Model, ...]:
    """Train once a seed; the first model tells what any of the trainings warns of."""
    first, *others = (train_on(frames, pipelines, each, base=base) for each in settings.by_seed())
    told = [
        f"seed {seed}: {warning}"
        for seed, model in enumerate(others, settings.seed + 1)
        for warning in model.warnings
    ]
    return replace(first, warnings=(*warnings, *first.warnings, *told)), *others


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
            '`topics.truth`, leave the drive out, or set training.source = "patch"'
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
    base: Model | None = None,
) -> Model:
    """Train on decoded frames; their truths, where they have any, make the baseline.

    ``warnings`` are put before those of the training itself, which builds on ``base``.
    """
    truths = [frame.truth for frame in frames if frame.truth is not None]
    prior = BlindPrior.of_truths(truths).road if truths else None
    model = fit(frames, pipelines, settings, prior, base)
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
    chosen = frozenset(evenly(numbers, count))
    for _, frame in decoded(each for each in frames() if each.number in chosen):
        yield frame
