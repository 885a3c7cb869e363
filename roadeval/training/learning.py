"""The choice of a run's training frames, and the fit of each variant to them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.data import IGNORE, NON_ROAD, ROAD, Frame, Rgb, Role, Truth
from roadeval.data.words import listing
from roadeval.errors import RoadevalError
from roadeval.evaluation.score.frame import BlindPrior
from roadeval.logs.frames import LoggedFrame
from roadeval.logs.truth.picks import Picks, Why
from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.reference_patch import patch_mask
from roadeval.pipeline.scene import expose_by_patch, reach, scene_of, stretch
from roadeval.pipeline.stage import Output, TrainingSet, View
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.threads import map_ordered
from roadeval.training.model import Model, load_cached_model
from roadeval.training.settings import TrainingSettings

WIDTH: Final = 160
"""Columns of the working image on which the distance from the reference patch is computed."""
_AT_ONCE: Final = 2
"""Variants that are fitted together; each holds its filtered images meanwhile."""

Pipelines = Mapping[str, Pipeline]
"""Pipelines by variant."""


class TrainingError(RoadevalError):
    """Frames from which nothing can be learnt."""


WITHOUT_TRAINING: Final = Sentence(
    "give {training.model}, or score only masks or networks with {only}"
)


def fit(
    frames: Sequence[Frame],
    pipelines: Pipelines,
    settings: TrainingSettings,
    base: Model | None = None,
) -> Model:
    """Return a model of the variants that learn and of the baseline, from decoded frames.

    A `TrainingError` if some variant learns and there is no frame, or the frames show only road or
    no road at all. The frames have truth, unless ``settings.source`` allows the patch. ``base`` is
    a model of other drives: stages that can learn further do so, the others stay unchanged.
    """
    learning = [name for name, pipeline in pipelines.items() if pipeline.learning_stages()]
    if learning and not frames:
        raise TrainingError("there is no frame to train on in the selected range")
    truths = [frame.truth for frame in frames if frame.truth is not None]
    prior = BlindPrior.of_truths(truths).road if truths else None
    source, share = "truth" if frames else "none", None
    if len(truths) < len(frames) or (frames and settings.source == "patch"):
        if settings.source == "truth":
            raise TrainingError(
                "there is no truth to train on",
                remedy=Sentence(
                    "name its topic with {topics.truth}, give {training.model}, or allow "
                    'training.source = "patch"'
                ),
            )
        source, truths = "patch", [patch_truth(frame.image, settings) for frame in frames]
    else:
        road = sum(np.count_nonzero(truth == ROAD) for truth in truths)
        share = road / (sum(np.count_nonzero(truth != IGNORE) for truth in truths) or 1)
    parameters: dict[str, dict[str, Any]] = {name: {} for name in pipelines}
    pixels = 0
    if learning:
        drawn = sample(truths, settings)
        if not (pixels := len(drawn.road)):
            raise TrainingError(
                f"frames {frames[0].number} to {frames[-1].number} do not show both road and "
                "non-road, so nothing can be learnt from them",
                remedy=Sentence(
                    "choose other frames with {frames.start} or {training.frames}, or give "
                    "{training.model}"
                ),
            )
        images = tuple(frame.image for frame in frames)
        drawn = replace(drawn, images=images, truths=tuple(truths), share=share)

        def learn(name: str) -> dict[str, Any]:
            learnt = base.parameters.get(name, {}) if base else {}
            return fit_stages(frames, drawn, pipelines[name], learnt)

        parameters |= zip(learning, map_ordered(learn, learning, _AT_ONCE), strict=True)
    return Model(
        parameters,
        {name: pipeline.relevant_settings() for name, pipeline in pipelines.items()},
        source,
        frozenset(frame.digest() for frame in frames) | (base.digests if base else frozenset()),
        pixels,
        prior,
    )


def fit_stages(
    frames: Sequence[Frame], training_set: TrainingSet, pipeline: Pipeline, base: Mapping[str, Any]
) -> dict[str, Any]:
    """Fit the stages in order, and return their parameters.

    A stage after a filter learns from the filtered images, and a stage that hears another one from
    its outputs.
    """
    parameters = dict(base)
    heard = pipeline.heard_stages()
    for stage in pipeline.stages():
        settings = pipeline.settings[stage.name]
        if stage.fit is not None and stage.name not in base:
            parameters[stage.name] = stage.fit(training_set, settings)
        elif stage.adapt is not None:
            parameters[stage.name] = stage.adapt(base[stage.name], training_set, settings)
        if stage.yields_mask and stage not in heard:
            continue
        run = stage.bind(settings, parameters.get(stage.name))
        pairs = zip(frames, training_set.images, strict=True)
        views = (View.of_frame(frame).after(Output(image=image)) for frame, image in pairs)
        after = (view.after(run(view)) for view in views)
        if stage.yields_mask:
            opinions = tuple(view.opinion and replace(view.opinion, layers=()) for view in after)
            training_set = replace(training_set, opinions=opinions)
        else:
            training_set = replace(training_set, images=tuple(view.image for view in after))
    return parameters


def sample(truths: Sequence[Truth], settings: TrainingSettings) -> TrainingSet:
    """Draw pixels of both classes from the truths of the training frames, without the images.

    Each frame gives at most ``pixels_per_class`` of either class; then the larger class is thinned
    to the size of the other, so that the sample is balanced however little road (or sky) a frame
    shows. Ignored pixels are never drawn. The same truths and settings give the same pixels.
    """
    rng = np.random.default_rng(settings.seed)
    share = max(1, min(settings.pixels_per_class, settings.max_pixels // (2 * len(truths))))
    classes = []
    for value in (ROAD, NON_ROAD):
        drawn = []
        for index, truth in enumerate(truths):
            flat = np.flatnonzero(truth == value)
            chosen = np.sort(rng.choice(flat, min(share, len(flat)), replace=False))
            places = np.unravel_index(chosen, truth.shape)
            drawn.append(np.stack([np.full(len(chosen), index), *places]))
        classes.append(np.concatenate(drawn, axis=1))
    size = min(*(drawn.shape[1] for drawn in classes), settings.max_pixels // 2)
    thinned = [drawn[:, np.sort(rng.permutation(drawn.shape[1])[:size])] for drawn in classes]
    frame, row, column = np.concatenate(thinned, axis=1)
    return TrainingSet((), frame, row, column, np.arange(2 * size) < size, settings.seed)


def patch_truth(image: Rgb, settings: TrainingSettings) -> Truth:
    """Guess the truth of an ``(H, W, 3)`` uint8 RGB image from its reference patch.

    The ground right in front of a vehicle is road, and so are pixels that a path from there reaches
    without crossing a strong edge, such as a kerb, a wall or another vehicle. Road (1) is the
    patch, and every pixel below the horizon row and nearer to the patch than ``settings.far``, see
    `reach`; all others are not (0). The patch also sets the exposure. Returns ``(H, W)`` uint8.
    """
    height, width = image.shape[:2]
    scene = scene_of(expose_by_patch(image, settings.patch), WIDTH, settings.patch)
    near = stretch(reach(scene), image.shape) < settings.far
    near[: round(settings.horizon * height)] = False
    near |= patch_mask(height, width, settings.patch) > 0
    return np.where(near, np.uint8(ROAD), np.uint8(NON_ROAD))


@dataclass(frozen=True)
class Schedule:
    """The frames of a run: which trained the model, which are left out, and which are evaluated."""

    digests: frozenset[str] = frozenset()
    """Hashes of the frames that trained the model."""
    trained: frozenset[int] = frozenset()
    """Numbers of those frames, if this run's log has all of them."""
    gap: frozenset[int] = frozenset()
    """Numbers of the frames after them that are left out as well."""
    first: int | None = None
    """Number of the first frame to evaluate, if it is known beforehand."""
    picks: Picks | None = None
    """The frames that were picked to be labelled; only those drawn at random are evaluated."""

    def role(self, frame: Frame) -> Role:
        """Return the use of a decoded frame."""
        if frame.digest() in self.digests:
            copied = self.trained and frame.number not in self.trained
            return Role.COPY if copied else Role.TRAINING
        if frame.number in self.gap:
            return Role.GAP
        if frame.truth is None or (frame.truth == IGNORE).all():
            return Role.UNLABELLED
        if self.picks is not None:
            if self.picks.is_proposal(frame.stamp_ns, frame.truth):
                return Role.UNLABELLED
            if not self.picks.is_picked(frame.stamp_ns, Why.RANDOM):
                return Role.PICKED
        return Role.EVALUATED


GREATEST_MEMORY: Final = 2 << 30
"""Bytes that the training frames of a run may take."""
BY_PATCH: Final = (
    "the model learnt from the reference patch in front of the vehicle, which is a guess"
)


def from_file(path: Path, pipelines: Pipelines) -> tuple[Model, Schedule]:
    """Read a model file and check that it was made for these variants.

    Binding the variants then checks that its parameters fit their settings.
    """
    stages = (stage for pipeline in pipelines.values() for stage in pipeline.stages())
    model = load_cached_model(path, tuple(dict.fromkeys(stages)))
    for name, pipeline in pipelines.items():
        model.require(name, pipeline, path)
    return model, Schedule(model.digests)


Frames = Callable[..., Iterable[LoggedFrame]]
"""A function that returns the frames of a range in order, from the first at each call. If numbers
of frames, or labelled frames, are asked for, it may leave out all others."""


def from_log(
    frames: Frames,
    pipelines: Pipelines,
    settings: TrainingSettings,
    on_frame: Callable[[int], None],
    *,
    labelled: bool,
    base: Model | None = None,
    picks: Picks | None = None,
) -> tuple[Model, Schedule]:
    """Train on some frames of a log; return the model and the schedule of the run.

    A `TrainingError` if there is nothing to learn from, or no frame is left to evaluate. Only as
    many ``frames`` of the selected range are decoded as are needed; ``on_frame`` receives their
    number so far. With ``labelled`` the log's truth may be used: then only labelled frames train,
    and some must be left to evaluate; if no frame of the range is labelled, the first ones train.
    ``base`` is a model of other drives, to learn further. With ``picks`` the frames picked by rank
    train.
    """
    learning = [name for name, pipeline in pipelines.items() if pipeline.learning_stages()]
    if not learning:
        return fit((), pipelines, settings), Schedule(picks=picks)
    if not settings.frames:
        problem = f"must be at least 1, because {listing(learning)} must learn"
        raise TrainingError(problem, setting="training.frames", remedy=WITHOUT_TRAINING)
    held, schedule = HeldFrames(on_frame), Schedule()
    if labelled and picks:
        in_range = frames(labelled=True)
        ranked = (frame for frame in in_range if picks.is_picked(frame.stamp_ns, Why.RANKED))
        for frame in decode_all(ranked):
            if frame.truth is not None and not picks.is_proposal(frame.stamp_ns, frame.truth):
                held.add(frame)
    with_truth = labelled and picks is None
    with_truth = with_truth and any(frame.labelled for frame in frames(labelled=True))
    by_truth = with_truth or bool(held.frames)
    if base is not None:
        require_adaptable(pipelines, settings, by_truth=by_truth)
    if not held.frames:
        schedule = choose_frames(frames, settings, held, with_truth=with_truth)
    warnings = []
    if labelled and not by_truth:
        lacking = "was picked by rank is labelled" if picks else "is read has road truth"
        warnings.append(f"no frame that {lacking}: {BY_PATCH}")
    if base is not None:
        kind = "labelled frames" if by_truth else "frames, by the reference patch in them,"
        warnings.append(
            f"the model of other drives ({settings.model}) was adapted to this drive with "
            f"{len(held.frames)} of its own {kind}: on a new drive the rates are others"
        )
    model = fit(held.frames, pipelines, settings, base)
    trained = () if base else (frame.number for frame in held.frames)
    schedule = replace(schedule, digests=model.digests, trained=frozenset(trained), picks=picks)
    return replace(model, warnings=tuple(warnings)), schedule


def require_adaptable(pipelines: Pipelines, settings: TrainingSettings, *, by_truth: bool) -> None:
    """Raise a `TrainingError` if a model of other drives cannot or should not learn further."""
    for name, pipeline in pipelines.items():
        learning = [stage for stage in pipeline.stages() if stage.fit is not None]
        if learning and not any(stage.adapt for stage in learning):
            raise TrainingError(
                f"no stage of it can learn further ({', '.join(s.name for s in learning)})",
                where=f"variant {name}",
                remedy=Sentence("use preset robust, or leave {training.adapt} out"),
            )
    if not by_truth and settings.source != "patch":
        raise TrainingError(
            "no frame of the range has road truth to adapt the model to, and guesses by the "
            "reference patch may make it worse",
            remedy=Sentence('leave {training.adapt} out, or insist with training.source = "patch"'),
        )


def choose_frames(
    frames: Frames, settings: TrainingSettings, held: HeldFrames, *, with_truth: bool
) -> Schedule:
    """Hold ``settings.frames`` training frames; return the schedule with the gap around them.

    They are the first frames, and the gap lies after them; or they are spread at equal distances,
    and a gap lies on both sides of each. If ``with_truth``, all of them are labelled, and another
    labelled frame must be left to evaluate; a `TrainingError` if none is.
    """
    numbers: list[int] = []

    def candidates() -> Iterator[LoggedFrame]:
        for frame in frames(labelled=with_truth):
            if frame.labelled or not with_truth:
                numbers.append(frame.number)
                yield frame

    following, lost = candidates(), dict[int, str]()
    if is_spread := settings.placement == "spread":
        deque(following, 0)  # to the end: then `numbers` is complete
        chosen = frozenset(choose_evenly(numbers, settings.frames))
        following = (frame for frame in frames(chosen) if frame.number in chosen)
    for frame in islice(decode_all(following, lost), settings.frames):
        held.add(frame)
    gap = settings.gap or 0
    if not is_spread:
        deque(islice(following, gap + 1), 0)  # so that the gap is in `numbers`, too
    elif settings.gap is None:
        gap = max(1, len(numbers) // max(4 * len(held.frames), 1))
    if lost and not held.frames:
        first, *_ = lost.values()
        problem = "none of the {} frames to train on can be decoded; the first: {}"
        raise TrainingError(Sentence(problem, len(lost), first))
    trained = {frame.number for frame in held.frames}
    places = {place for place, number in enumerate(numbers) if number in trained}
    near = {place + by for place in places for by in range(-gap * is_spread, gap + 1)} - places
    beside = frozenset(number for place, number in enumerate(numbers) if place in near)
    left = [number for number in numbers if number not in beside | trained | lost.keys()]
    if with_truth and trained and not left:
        fewer = max(len(numbers) // (2 + 2 * gap), 1)
        # With a long gap one training frame is too many.
        change = "lower {training.gap}, " if beside else ""
        change = f"set {{training.frames}} to {fewer}, " if len(numbers) > 1 + gap else change
        used = f" ({len(trained)}) or left out as its gap ({len(beside)})" if beside else ""
        raise TrainingError(
            f"all {len(numbers)} labelled frames in the range are used for training{used}, so none "
            "is left to score",
            remedy=Sentence("{}{}", Sentence(change), WITHOUT_TRAINING),
        )
    return Schedule(gap=beside, first=left[0] if left else None)


def from_drives(
    frames: Mapping[Path, Sequence[Frame]], pipelines: Pipelines, settings: TrainingSettings
) -> Model:
    """Train on frames of some drives, by the drives' paths.

    A `TrainingError` if there is nothing to learn from; or some drives have truth and others have
    none; or none has truth and the settings insist on it.
    """
    bare = [path for path, drawn in frames.items() if all(f.truth is None for f in drawn)]
    insists = settings.source == "truth" or len(bare) < len(frames)
    if bare and insists and settings.source != "patch":
        raise TrainingError(
            "no road truth to train on in the range",
            where=bare[0],
            remedy=Sentence(
                "name its topic with {topics.truth}, leave the drive out, or set training.source "
                '= "patch"'
            ),
        )
    model = fit([*chain.from_iterable(frames.values())], pipelines, settings)
    if not bare or settings.source == "patch":
        return model
    return replace(model, warnings=(f"no drive has road truth in the range: {BY_PATCH}",))


def decode_evenly(
    frames: Callable[[], Iterable[LoggedFrame]], count: int, *, labelled: bool
) -> Iterator[Frame]:
    """Decode ``count`` frames at equal distances.

    ``frames`` starts from the first frame at each call: one call lists them, one reads them. With
    ``labelled`` only frames with truth are taken, if there are any.
    """
    is_labelled = {frame.number: frame.labelled for frame in frames()}
    numbers = [number for number in is_labelled if is_labelled[number] and labelled]
    chosen = frozenset(choose_evenly(numbers or [*is_labelled], count))
    return decode_all(frame for frame in frames() if frame.number in chosen)


class HeldFrames:
    """The decoded training frames of a run, which are all in memory until it has trained.

    ``on_frame`` receives their number after each.
    """

    def __init__(self, on_frame: Callable[[int], None] = lambda _count: None) -> None:
        self.frames: list[Frame] = []
        self._on_frame = on_frame
        self._bytes = 0

    def add(self, frame: Frame) -> None:
        """Hold a frame; a `TrainingError` if there is no room for it."""
        masks = [frame.truth, frame.shadow_truth, *frame.external.values()]
        # Two filters in a row make two more images of each frame while a variant is fitted.
        size = 3 * frame.image.nbytes + sum(mask.nbytes for mask in masks if mask is not None)
        size += sum(codes.nbytes for codes in frame.probabilities.values())
        self._bytes += size + len(frame.payload)
        if self._bytes > GREATEST_MEMORY:
            raise TrainingError(
                f"training holds its frames decoded, and more than {len(self.frames)} of them "
                f"would take over {GREATEST_MEMORY >> 20} MiB",
                remedy=Sentence("lower {training.frames}, or reduce them with {frames.scale}"),
            )
        self.frames.append(frame)
        self._on_frame(len(self.frames))


def choose_evenly(numbers: Sequence[int], count: int) -> list[int]:
    """Return ``count`` of the numbers, or all if there are fewer, at equal distances.

    >>> choose_evenly(range(20, 30), 4)
    [20, 22, 25, 27]
    """
    taken = min(count, len(numbers))
    return [numbers[i * len(numbers) // taken] for i in range(taken)]


def decode_all(
    frames: Iterable[LoggedFrame], lost: dict[int, str] | None = None
) -> Iterator[Frame]:
    """Yield the frames that can be decoded; ``lost`` receives the others' errors by number.

    The replay reports these errors again.
    """
    for frame in frames:
        try:
            yield frame.decode()
        except RoadevalError as error:
            if lost is not None:
                lost[frame.number] = error.sentence
