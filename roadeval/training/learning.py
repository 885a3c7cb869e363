"""Where a run's model comes from, and how every variant is fitted to the same frames and pixels."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, NON_ROAD, ROAD, Frame, Rgb, Role, Truth
from roadeval.errors import RoadevalError
from roadeval.evaluation.score import BlindPrior
from roadeval.logs import LoggedFrame, Picks, Why
from roadeval.pipeline.beyond.exposure import ExposureSettings, expose, gains
from roadeval.pipeline.beyond.features import reach
from roadeval.pipeline.beyond.scene import scene_of, stretched
from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.reference_patch import patch_mask
from roadeval.pipeline.stage import Output, StageError, TrainingSet, View
from roadeval.runtime.threads import ordered
from roadeval.training.model import Model, kept_model
from roadeval.training.settings import TrainingSettings

COLLAPSED: Final = 0.001
"""A classifier that calls less than this share of its training frames road, or more than the
rest of it, has collapsed."""
WIDTH: Final = 160
"""Columns of the working image on which paths are sought from the reference patch."""
_AT_ONCE: Final = 2
"""Variants that are fitted together; each holds its filtered images meanwhile."""


class TrainingError(RoadevalError):
    """Frames from which nothing can be learnt."""


def fit(
    frames: Sequence[Frame],
    pipelines: Mapping[str, Pipeline],
    settings: TrainingSettings,
    warnings: Sequence[str] = (),
    base: Model | None = None,
) -> Model:
    """Train every variant that learns anything on decoded frames.

    Their truths, where they have any, make the baseline. A `TrainingError` if there is no frame, or
    if the frames show road alone or no road at all and some variant has something to learn. The
    frames have truth, unless ``settings.source`` allows the patch. ``warnings`` are put before
    those of the training itself. ``base`` is what the variants have learnt from other drives:
    stages that can learn further do so, the others stay as they are.
    """
    learning = {name: pipeline for name, pipeline in pipelines.items() if pipeline.learning()}
    source, truths = _truths(frames, settings)
    parameters: dict[str, dict[str, Any]] = {name: {} for name in pipelines}
    found = [*warnings]
    pixels = 0
    if learning:
        sampled = _sampled(frames, truths, settings)
        if source == "truth":
            road = sum(np.count_nonzero(truth == ROAD) for truth in truths)
            sampled = dataclasses.replace(
                sampled, share=(road / sum(np.count_nonzero(truth != IGNORE) for truth in truths))
            )
        pixels = len(sampled.road)
        each = partial(_fit_variant, frames, sampled, {} if base is None else base.parameters)
        for name, learnt, warned in ordered(each, learning.items(), _AT_ONCE):
            parameters[name] = learnt
            found += warned
    labelled = [frame.truth for frame in frames if frame.truth is not None]
    return Model(
        parameters,
        {name: pipeline.relevant() for name, pipeline in pipelines.items()},
        source,
        frozenset(frame.digest() for frame in frames) | (base.digests if base else frozenset()),
        pixels,
        BlindPrior.of_truths(labelled).road if labelled else None,
        tuple(found),
    )


def _truths(frames: Sequence[Frame], settings: TrainingSettings) -> tuple[str, list[Truth]]:
    if not frames:
        raise TrainingError("there is no frame to train on in the selected range")
    labelled = [frame.truth for frame in frames if frame.truth is not None]
    if settings.source != "patch" and len(labelled) == len(frames):
        return "truth", labelled
    if settings.source == "truth":
        raise TrainingError(
            "there is no truth to train on: name its topic with `topics.truth`, give "
            '`training.model`, or allow training.source = "patch"'
        )
    return "patch", [patch_truth(frame.image, settings) for frame in frames]


def _sampled(
    frames: Sequence[Frame], truths: list[Truth], settings: TrainingSettings
) -> TrainingSet:
    """Draw the pixels that every variant learns from."""
    sampled = sample(truths, settings)
    if not len(sampled.road):
        raise TrainingError(
            f"frames {frames[0].number} to {frames[-1].number} do not show both road and non-road, "
            "so nothing can be learnt from them; choose other frames with `frames.start` or "
            "`training.frames`, or give `training.model`"
        )
    images = tuple(frame.image for frame in frames)
    return dataclasses.replace(sampled, images=images, truths=tuple(truths))


def _fit_variant(
    frames: Sequence[Frame],
    sampled: TrainingSet,
    base: Mapping[str, Mapping[str, Any]],
    variant: tuple[str, Pipeline],
) -> tuple[str, dict[str, Any], list[str]]:
    """Return the variant's name, what its stages learn, and the warnings."""
    name, pipeline = variant
    learnt = _fit_stages(frames, sampled, pipeline, base.get(name, {}))
    return name, learnt, _collapsed(name, frames, pipeline, learnt)


def _fit_stages(
    frames: Sequence[Frame], training_set: TrainingSet, pipeline: Pipeline, base: Mapping[str, Any]
) -> dict[str, Any]:
    """Fit the stages in order.

    What follows a filter learns from the filtered images, and what hears another method from what
    that says of them.
    """
    parameters: dict[str, Any] = dict(base)
    heard = {stage.name for stage in pipeline.heard()}
    for stage in pipeline.stages():
        settings = pipeline.settings[stage.name]
        if stage.fit is not None and stage.name not in base:
            parameters[stage.name] = stage.fit(training_set, settings)
        elif stage.adapt is not None:
            parameters[stage.name] = stage.adapt(base[stage.name], training_set, settings)
        if not stage.yields_mask:
            only = pipeline.alone(stage.name).bind(parameters)
            filtered = tuple(only.filtered(image) for image in training_set.images)
            training_set = dataclasses.replace(training_set, images=filtered)
        elif stage.name in heard:
            (step,) = pipeline.alone(stage.name).bind(parameters).steps
            seen = zip(frames, training_set.images, strict=True)
            views = (View.of_frame(each).after(Output(image=image)) for each, image in seen)
            opinions = tuple(view.after(step.run(view)).opinion for view in views)
            training_set = dataclasses.replace(training_set, opinions=opinions)
    return parameters


def _collapsed(
    variant: str, frames: Sequence[Frame], pipeline: Pipeline, parameters: Mapping[str, Any]
) -> list[str]:
    """Return a warning for each stage that calls all or none of its training frames road."""
    chain = pipeline.bind(parameters)
    shares: dict[str, list[float]] = {}
    for frame in frames:
        with suppress(StageError):  # it is reported when the frame is replayed
            for name, output in chain.run(View.of_frame(frame)):
                if output.mask is not None:
                    pixels = frame.image[..., 0].size
                    shares.setdefault(name, []).append(output.mask.area() / pixels)
    return [
        f"{variant}: {name} has collapsed: it calls {share:.1%} of its own training frames road"
        for name, share in ((name, float(np.mean(values))) for name, values in shares.items())
        if not COLLAPSED <= share <= 1 - COLLAPSED
    ]


def sample(truths: Sequence[Truth], settings: TrainingSettings) -> TrainingSet:
    """Draw pixels of both classes from the truths of the training frames, without the images.

    Each frame gives at most ``pixels_per_class`` of either class; then the class that has more
    is thinned to the size of the other, so that the sample is balanced however little road (or
    sky) a frame shows. Ignored pixels are never drawn. The same truths and settings give the
    same pixels.
    """
    rng = np.random.default_rng(settings.seed)
    share = max(1, min(settings.pixels_per_class, settings.max_pixels // (2 * len(truths))))
    classes = [_draw(truths, value, share, rng) for value in (ROAD, NON_ROAD)]
    size = min(*(len(drawn) for drawn in classes), settings.max_pixels // 2)
    places = np.concatenate(
        [drawn[np.sort(rng.permutation(len(drawn))[:size])] for drawn in classes]
    )
    frame, row, column = places.T
    return TrainingSet((), frame, row, column, np.arange(2 * size) < size, settings.seed)


def _draw(
    truths: Sequence[Truth], value: int, share: int, rng: np.random.Generator
) -> npt.NDArray[np.intp]:
    """Return frame, row and column of some pixels of a value, at most ``share`` a frame."""
    drawn = []
    for index, truth in enumerate(truths):
        flat = np.flatnonzero(truth == value)
        chosen = rng.choice(flat, min(share, len(flat)), replace=False)
        rows, columns = np.unravel_index(np.sort(chosen), truth.shape)
        drawn.append(np.stack([np.full(len(chosen), index), rows, columns], axis=1))
    return np.concatenate(drawn).astype(np.intp)


def patch_truth(image: Rgb, settings: TrainingSettings) -> Truth:
    """Guess the truth of an ``(H, W, 3)`` uint8 RGB image from its reference patch.

    The ground right in front of a vehicle is road, and so is what can be reached from there without
    crossing a strong edge, such as a kerb, a wall or another vehicle.
    Road (1) is the patch, and what lies below the horizon row and nearer to the patch than
    ``settings.far``, see `reach`; all else is not (0). The patch also sets the exposure. Returns
    ``(H, W)`` uint8.
    """
    height, width = image.shape[:2]
    exposure = ExposureSettings(patch=settings.patch)
    exposed = expose(image, gains(image, exposure), exposure.level)
    near = stretched(reach(scene_of(exposed, WIDTH, settings.patch)), image.shape) < settings.far
    near[: round(settings.horizon * height)] = False
    near |= patch_mask(height, width, settings.patch) > 0
    return np.where(near, np.uint8(ROAD), np.uint8(NON_ROAD))


@dataclass(frozen=True, slots=True)
class Schedule:
    """The frames of a run: which trained the model, which are left out, and which are evaluated."""

    digests: frozenset[str]
    """Hashes of the frames that trained the model."""
    gap: frozenset[int] = frozenset()
    """Numbers of the frames after them that are left out as well."""
    first: int | None = None
    """Number of the first frame to evaluate, where it is known beforehand."""
    picks: Picks | None = None
    """Which frames were picked to be labelled: those that were drawn at random are evaluated."""

    def role(self, frame: Frame) -> Role:
        """Return what a decoded frame is used for."""
        if frame.digest() in self.digests:
            return Role.TRAINING
        if frame.number in self.gap:
            return Role.GAP
        if frame.truth is None:
            return Role.UNLABELLED
        if self.picks is not None:
            if self.picks.is_proposal(frame.stamp_ns, frame.truth):
                return Role.UNLABELLED
            if frame.stamp_ns not in self.picks.stamps_of(Why.RANDOM):
                return Role.PICKED
        return Role.EVALUATED


GREATEST_MEMORY: Final = 2 << 30
"""Bytes that the training frames of a run may take."""
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
    return model, Schedule(model.digests)


Frames = Callable[..., Iterable[LoggedFrame]]
"""Returns the frames of a range, in order and from the first at each call; given some numbers it
may leave out all others."""


def from_log(
    frames: Frames,
    pipelines: Mapping[str, Pipeline],
    settings: TrainingSettings,
    on_frame: Callable[[int], None],
    *,
    labelled: bool,
    base: Model | None = None,
    picks: Picks | None = None,
) -> tuple[tuple[Model, ...], Schedule]:
    """Train on some frames of a log, with each seed of the settings.

    A `TrainingError` if there is nothing to learn from, or nothing left to evaluate. Of the
    ``frames`` of the selected range only as many are decoded as are needed, and ``on_frame`` is
    called with the number of those so far. ``labelled`` says that the log's truth may be used: then
    only frames that have one train, and some must be left to evaluate. Where no frame of the range
    has one, the first ones train. ``base`` is what was learnt from other drives. With ``picks``
    those train that were picked by rank. Returned are the model of each seed, the first with the
    warnings of all, and which frames are left out.
    """
    if base is not None:
        _require_adaptable(pipelines)
    ranked = _of_picks(frames, picks, on_frame) if picks and labelled else None
    candidates, by_truth = _candidates(frames, labelled=labelled and picks is None)
    by_truth = by_truth or ranked is not None
    if base is not None and not by_truth and settings.source != "patch":
        raise TrainingError(
            "no frame of the range has road truth to adapt the model to, and what the reference "
            "patch guesses may make it worse: leave `training.adapt` out, or insist with "
            'training.source = "patch"'
        )
    learning = [name for name, pipeline in pipelines.items() if pipeline.learning()]
    if not learning:
        made_for = {name: pipeline.relevant() for name, pipeline in pipelines.items()}
        nothing = Model({name: {} for name in pipelines}, made_for, "none", frozenset(), 0)
        return (nothing,), Schedule(frozenset(), picks=picks)
    if not settings.frames:
        raise TrainingError(
            f"`training.frames` is 0, and {', '.join(learning)} must learn: give `training.model`, "
            "or run what learns nothing with `only`"
        )
    if settings.placement == "spread":
        chosen = ranked or _spread_out(candidates, frames, settings, on_frame, by_truth=by_truth)
    else:
        chosen = ranked or _from_the_first(candidates, settings, on_frame, by_truth=by_truth)
    held, schedule = chosen
    warnings = []
    if labelled and not by_truth:
        what = "no frame that is read has road truth"
        what = what if picks is None else "no frame that was picked by rank is labelled"
        warnings.append(f"{what}: {BY_PATCH}")
    if base is not None:
        how = "labelled frames" if by_truth else "frames, by the reference patch in them,"
        warnings.append(
            f"the model of other drives ({settings.model}) was adapted to this drive with "
            f"{len(held)} of its own {how}: the rates are not those on a drive that it has not seen"
        )
    models = _with_each_seed(held, pipelines, settings, warnings, base)
    return models, replace(schedule, digests=models[0].digests, picks=picks)


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


def _with_each_seed(
    frames: Sequence[Frame],
    pipelines: Mapping[str, Pipeline],
    settings: TrainingSettings,
    warnings: Sequence[str],
    base: Model | None,
) -> tuple[Model, ...]:
    """Train once with each seed; the first model has the warnings of all."""
    first, *others = (fit(frames, pipelines, each, base=base) for each in settings.by_seed())
    more = [
        f"seed {seed}: {warning}"
        for seed, model in enumerate(others, settings.seed + 1)
        for warning in model.warnings
    ]
    return replace(first, warnings=(*warnings, *first.warnings, *more)), *others


def from_drives(
    frames: Mapping[Path, Sequence[Frame]],
    pipelines: Mapping[str, Pipeline],
    settings: TrainingSettings,
) -> Model:
    """Train on frames of some drives, by the drives' paths.

    A `TrainingError` if some drives have truth and others have none, or none has although the
    settings insist on it, or there is nothing to learn from.
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
    every = [frame for own in frames.values() for frame in own]
    return fit(every, pipelines, settings, guess)


def spread(
    frames: Callable[[], Iterable[LoggedFrame]], count: int, *, labelled: bool
) -> Iterator[Frame]:
    """Decode ``count`` frames, spread evenly over those that there are.

    ``frames`` begins anew at each call: once to see which there are, once to read them. Where
    ``labelled``, those with truth alone are taken, if there is any.
    """
    seen = {frame.number: frame.labelled for frame in frames()}
    numbers = [number for number, has_truth in seen.items() if has_truth and labelled] or [*seen]
    chosen = frozenset(evenly(numbers, count))
    yield from decoded(each for each in frames() if each.number in chosen)


class HeldFrames:
    """The training frames of a run: decoded, all of them, as long as it trains."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self._bytes = 0

    def add(self, frame: Frame) -> None:
        """Hold a frame; a `TrainingError` if there is no room for it."""
        masks = [frame.truth, frame.shadow_truth, *frame.external.values()]
        # Two filters in a row leave two more images of each frame while a variant is fitted.
        size = 3 * frame.image.nbytes + sum(mask.nbytes for mask in masks if mask is not None)
        size += sum(each.nbytes for each in frame.probabilities.values())
        self._bytes += size + len(frame.payload)
        if self._bytes > GREATEST_MEMORY:
            raise TrainingError(
                f"training holds its frames decoded, and more than {len(self.frames)} of them "
                f"would take over {GREATEST_MEMORY >> 20} MiB: lower `training.frames`, or reduce "
                "them with `frames.scale`"
            )
        self.frames.append(frame)


def _candidates(frames: Frames, *, labelled: bool) -> tuple[Iterator[LoggedFrame], bool]:
    """Return the labelled frames and True; if there are none, all frames and False."""
    if labelled:
        with_truth = (frame for frame in frames() if frame.labelled)
        for first in with_truth:
            return chain([first], with_truth), True
    return iter(frames()), False


Chosen = tuple[Sequence[Frame], Schedule]
"""The frames that train, and what that means for the others."""


def _of_picks(frames: Frames, picks: Picks, on_frame: Callable[[int], None]) -> Chosen | None:
    """Choose all frames that were picked by rank and labelled since; None without any."""
    held, ranked = HeldFrames(), picks.stamps_of(Why.RANKED)
    for frame in decoded(e for e in frames() if e.labelled and e.stamp_ns in ranked):
        if frame.truth is None or picks.is_proposal(frame.stamp_ns, frame.truth):
            continue
        held.add(frame)
        on_frame(len(held.frames))
    return (held.frames, Schedule(frozenset())) if held.frames else None


def _from_the_first(
    candidates: Iterator[LoggedFrame],
    settings: TrainingSettings,
    on_frame: Callable[[int], None],
    *,
    by_truth: bool,
) -> Chosen:
    """Choose the first ``settings.frames`` frames; the gap lies after them.

    Only as many candidates are taken as are needed, in order. ``by_truth`` says that a frame must
    be left to evaluate. A `TrainingError` if none is left.
    """
    gap = settings.gap or 0
    held = _hold(candidates, settings.frames, on_frame)
    following = [readable.number for readable in islice(candidates, gap + 1)]
    if by_truth and held and len(following) <= gap:
        raise _none_left(len(held), gap, len(held) + len(following))
    first = following[gap] if len(following) > gap else None
    return held, Schedule(frozenset(), frozenset(following[:gap]), first)


def _spread_out(
    candidates: Iterator[LoggedFrame],
    frames: Frames,
    settings: TrainingSettings,
    on_frame: Callable[[int], None],
    *,
    by_truth: bool,
) -> Chosen:
    """Choose ``settings.frames`` frames at equal distances; a gap lies on both sides of each.

    Without ``settings.gap`` the gap is a quarter of that distance, and at least one frame. The
    parameters and errors are those of `_from_the_first`, but all candidates are taken, and those
    that are chosen are read again.
    """
    every = [each.number for each in candidates]
    asked = frozenset(evenly(every, settings.frames))
    held = _hold((e for e in frames(asked) if e.number in asked), settings.frames, on_frame)
    trained = {frame.number for frame in held}
    places = [place for place, number in enumerate(every) if number in trained]
    gap = settings.gap
    if gap is None:
        gap = max(1, len(every) // max(4 * len(trained), 1))
    near = {place + by for place in places for by in range(-gap, gap + 1)} - {*places}
    left = [number for place, number in enumerate(every) if place not in near | {*places}]
    if by_truth and trained and not left:
        raise _none_left(len(trained), len(near & {*range(len(every))}), len(every))
    beside = frozenset(number for place, number in enumerate(every) if place in near)
    return held, Schedule(frozenset(), beside, left[0] if left else None)


def evenly(numbers: Sequence[int], count: int) -> list[int]:
    """Return ``count`` of the numbers, or all if there are fewer, at equal distances.

    >>> evenly(range(20, 30), 4)
    [20, 22, 25, 27]
    """
    taken = min(count, len(numbers))
    return [numbers[i * len(numbers) // taken] for i in range(taken)]


def decoded(frames: Iterable[LoggedFrame], lost: list[str] | None = None) -> Iterator[Frame]:
    """Decode what can be decoded; ``lost`` receives why others cannot.

    They are reported when they are replayed.
    """
    for readable in frames:
        try:
            yield readable.decode()
        except RoadevalError as error:
            if lost is not None:
                lost.append(str(error))


def _hold(
    candidates: Iterator[LoggedFrame], count: int, on_frame: Callable[[int], None]
) -> list[Frame]:
    """Decode the first ``count`` frames."""
    held, lost = HeldFrames(), list[str]()
    for frame in decoded(candidates, lost):
        held.add(frame)
        on_frame(len(held.frames))
        if len(held.frames) == count:
            break
    if lost and not held.frames:
        none = f"none of the {len(lost)} frames to train on can be decoded"
        raise TrainingError(f"{none}; the first: {lost[0]}")
    return held.frames


def _none_left(trained: int, gap: int, total: int) -> TrainingError:
    return TrainingError(
        f"the range has {total} labelled frames, and training would take {trained} of them and "
        f"{gap} more as a gap: none is left to evaluate; set `training.frames` to "
        f"{max(total // 2 - gap, 1)}, give `training.model`, or run what learns nothing with `only`"
    )
