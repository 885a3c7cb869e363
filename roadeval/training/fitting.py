"""Fitting every variant on its own images of the same frames and pixels."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, NON_ROAD, ROAD, Frame, Rgb, Truth
from roadeval.errors import RoadevalError
from roadeval.pipeline.beyond.exposure import ExposureSettings, expose, gains
from roadeval.pipeline.beyond.features import reach
from roadeval.pipeline.beyond.scene import scene_of, stretched
from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.reference_patch import patch_mask
from roadeval.pipeline.stage import StageError, TrainingSet, View
from roadeval.runtime.threads import ordered
from roadeval.training.model import Model
from roadeval.training.schedule import fingerprint
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
    prior: npt.NDArray[np.float32] | None = None,
    base: Model | None = None,
) -> Model:
    """Train every variant that learns anything.

    A `TrainingError` if there is no frame, or if the frames show road alone or no road at all and
    some variant has something to learn. The frames have truth, unless ``settings.source`` allows
    the patch. ``prior`` is kept in the model for the baseline, see `Model`. ``base`` is what the
    variants have learnt from other drives: stages that can learn further do so, the others stay as
    they are.
    """
    learning = {name: pipeline for name, pipeline in pipelines.items() if pipeline.learning()}
    source, truths = _truths(frames, settings)
    parameters: dict[str, dict[str, Any]] = {name: {} for name in pipelines}
    warnings: list[str] = []
    pixels = 0
    if learning:
        sampled = _sampled(frames, truths, settings)
        if source == "truth":
            road = sum(np.count_nonzero(truth == ROAD) for truth in truths)
            sampled = dataclasses.replace(
                sampled, share=(road / sum(np.count_nonzero(truth != IGNORE) for truth in truths))
            )
        pixels = len(sampled.road)
        each = partial(_fit_variant, sampled, {} if base is None else base.parameters)
        for name, learnt, warned in ordered(each, learning.items(), _AT_ONCE):
            parameters[name] = learnt
            warnings += warned
    return Model(
        parameters,
        {name: pipeline.relevant() for name, pipeline in pipelines.items()},
        source,
        frozenset(frame.digest() for frame in frames) | (base.digests if base else frozenset()),
        pixels,
        prior,
        tuple(warnings),
        np.stack([fingerprint(frame.image) for frame in frames]),
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
    return dataclasses.replace(sampled, images=tuple(frame.image for frame in frames))


def _fit_variant(
    sampled: TrainingSet,
    base: Mapping[str, Mapping[str, Any]],
    variant: tuple[str, Pipeline],
) -> tuple[str, dict[str, Any], list[str]]:
    """Return the variant's name, what its stages learn, and the warnings."""
    name, pipeline = variant
    learnt = _fit_stages(sampled, pipeline, base.get(name, {}))
    return name, learnt, _collapsed(name, sampled.images, pipeline, learnt)


def _fit_stages(
    training_set: TrainingSet, pipeline: Pipeline, base: Mapping[str, Any]
) -> dict[str, Any]:
    """Fit the stages in order; what follows a filter learns from the filtered images."""
    parameters: dict[str, Any] = dict(base)
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
    return parameters


def _collapsed(
    variant: str, images: Sequence[Rgb], pipeline: Pipeline, parameters: Mapping[str, Any]
) -> list[str]:
    """Return a warning for each stage that calls all or none of its training frames road."""
    chain = pipeline.bind(parameters)
    shares: dict[str, list[float]] = {}
    for image in images:
        with suppress(StageError):  # it is reported when the frame is replayed
            for name, output in chain.run(View.of(image)):
                if output.mask is not None:
                    shares.setdefault(name, []).append(output.mask.area() / image[..., 0].size)
    return [
        f"{variant}: {name} has collapsed: it calls {share:.1%} of its own training frames road"
        for name, share in ((name, float(np.mean(values))) for name, values in shares.items())
        if not COLLAPSED <= share <= 1 - COLLAPSED
    ]


# --- Which pixels train ---------------------------------------------------------------------------


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


# --- A truth for logs that have none --------------------------------------------------------------


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
