"""A run over a log, prepared: topics, model, chains and scoreboard."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from roadeval import logs
from roadeval.config import RunConfig, Variant
from roadeval.data import VariantLayout
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.score import BlindPrior, Scoreboard
from roadeval.jobs.progress import OnProgress, Progress
from roadeval.jobs.run import frame
from roadeval.jobs.run.identity import identity
from roadeval.pipeline.chain import Chain
from roadeval.pipeline.stage import MisfitError, StageError
from roadeval.recording import Layout
from roadeval.results.rows import Key
from roadeval.results.schema import STREAMED, TABLES
from roadeval.runtime.memory import trim
from roadeval.training import Model, TrainingSettings, learning
from roadeval.training.model import ModelError
from roadeval.training.schedule import Schedule
from roadeval.version import VERSION

KEPT: Final = 5
"""Tracebacks that are kept: those of the first errors that say different things."""


@dataclass(frozen=True, slots=True)
class Failures:
    """The frames on which a stage has failed so far; any thread may add to them."""

    reasons: dict[int, str] = field(default_factory=dict)
    """By the frame's number: which stage failed, and why."""
    tracebacks: dict[str, str] = field(default_factory=dict)
    """By such a reason."""

    def add(self, number: int, error: StageError) -> None:
        """Note that a stage failed on a frame. The error itself would hold the frame's images."""
        self.reasons[number] = str(error)
        if len(self.tracebacks) < KEPT and str(error) not in self.tracebacks:
            self.tracebacks[str(error)] = "".join(traceback.format_exception(error))

    def sentences(self) -> tuple[str, ...]:
        """Return a sentence for each frame, in the frames' order."""
        return tuple(f"frame {number}: {self.reasons[number]}" for number in sorted(self.reasons))


SPARSE: Final = 5
"""Where there are more frames than so many for each label, a note says so."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A prepared run: its frames, the chains that run on them, and the score so far."""

    log: logs.Log
    """The open log."""
    config: RunConfig
    """Every option."""
    selection: logs.Selection
    """The topics that are replayed, and why."""
    frames: logs.FrameStream
    """The frames that are read, and the account of them."""
    variants: tuple[Variant, ...]
    """The variants whose chains run."""
    model: Model
    schedule: Schedule
    """What they learnt, and which frames are not evaluated because of it."""
    chains: Mapping[str, Chain]
    """The variants' chains, ready to run, by name."""
    repeats: Mapping[int, Mapping[str, Chain]]
    """The same for each further seed of the training, by the seed."""
    layouts: tuple[VariantLayout, ...]
    """Every variant that is scored, those included whose masks the log carries."""
    methods: Mapping[str, Mapping[str, Any]]
    """What stages tell of themselves beside their settings, by variant and stage. It is read before
    the first frame: a file that they name may be gone after the last.
    """
    board: Scoreboard
    """The score so far."""
    beside: set[int] = field(default_factory=set)
    """The training frames of a model file that show a place of this drive, so far."""
    failures: Failures = field(default_factory=Failures)
    """The frames on which a stage failed, so far."""

    @property
    def key(self) -> Key:
        """What every row of its tables begins with."""
        return Key(self.log.name, self.selection.image.name)

    def layout(self) -> Layout:
        """Describe the recording before its first frame."""
        width, height = self.selection.size or (0, 0)
        return Layout(
            self.log.name,
            width,
            height,
            self.layouts,
            tuple(METRICS),
            baseline=self.model.prior is not None,
            has_truth=self.selection.truth is not None,
            has_shadow_truth=self.selection.shadow is not None,
            first_frame=self.schedule.first,
            rate_hz=self.selection.image.rate_hz,
            tables={name: TABLES[name].header for name in STREAMED},
            properties=self._properties(),
        )

    def _properties(self) -> dict[str, str | int | float]:
        masks = self.selection.digests()
        return {
            "version": VERSION,
            # The recording's identity comes from its layout, this digest included.
            "input": identity(self.log, self.config, masks),
            "drive": self.log.name,
            "preset": self.config.preset,
            "image_topic": self.selection.image.name,
            "truth_topic": self.selection.truth.where if self.selection.truth else "",
            "trained_on": self.model.source,
            "training_frames": len(self.model.digests),
        }


def prepare(log: logs.Log, config: RunConfig, on_progress: OnProgress) -> Run:
    """Select the topics of a log, train or read the model, and bind the variants' chains.

    A `RoadevalError` if the log, the configuration or the training leave nothing to run.
    """
    selection = log.select()
    again = partial(log.frames, selection)
    variants = config.variants()
    labelled = selection.truth is not None
    if note := _sparse(selection, len(again())):
        on_progress(Progress(0, None, "opening", note))
    # Without truth no rate could tell the trainings apart.
    training = config.training if labelled else replace(config.training, seeds=1)
    (model, *others), schedule = _learn(again, variants, training, on_progress, labelled=labelled)
    chains, *repeats = (_bind(variants, each, training.model) for each in (model, *others))
    trim()
    layouts = (*(variant.layout() for variant in variants), *_external(selection))
    prior = None if model.prior is None else BlindPrior(model.prior)
    board = Scoreboard(config.evaluation, [layout.name for layout in layouts], prior)
    return Run(
        log,
        config,
        selection,
        again(),
        variants,
        model,
        schedule,
        chains,
        dict(enumerate(repeats, training.seed + 1)),
        layouts,
        {each.name: told for each in variants if (told := each.pipeline.about())},
        board,
    )


def _sparse(selection: logs.Selection, frames: int) -> str:
    """Return a note where few of the frames that are read can have truth; else empty."""
    truths = frames if selection.truth is None else len(selection.truth.pictures)
    if frames <= SPARSE * truths:
        return ""
    return (
        f"at most {truths} of {frames} frames have road truth: `frames.labelled` reads these alone"
    )


def _learn(
    frames: Callable[[], logs.FrameStream],
    variants: tuple[Variant, ...],
    settings: TrainingSettings,
    on_progress: OnProgress,
    *,
    labelled: bool,
) -> tuple[tuple[Model, ...], Schedule]:
    pipelines = {variant.name: variant.pipeline for variant in variants}
    base = None
    if settings.model is not None:
        base, schedule = learning.from_file(Path(settings.model), pipelines)
        if not settings.adapt:
            return (base,), schedule
    total = min(settings.frames, len(frames()))
    return learning.from_log(
        frames,
        pipelines,
        settings,
        lambda done: on_progress(Progress(done, total, "training")),
        labelled=labelled and settings.source != "patch",
        base=base,
    )


def _bind(variants: tuple[Variant, ...], model: Model, path: str | None) -> Mapping[str, Chain]:
    try:
        return frame.bind(variants, model)
    except MisfitError as error:
        raise ModelError(f"{path}: {error}") from error


def _external(selection: logs.Selection) -> tuple[VariantLayout, ...]:
    """Describe the variants whose masks another system has made."""
    return tuple(
        frame.external_layout(name, mask.where, probable=mask.is_confidence)
        for name, mask in selection.masks.items()
    )
