"""A run over a log: its preparation, its identity, and its frames, which worker threads compute."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.config.run import RunConfig
from roadeval.config.settings import ExecutionSettings, FleetSettings, OutputSettings
from roadeval.config.variants import Variant
from roadeval.data import Calibration, Frame, FrameResult, Role, VariantLayout, VariantResult
from roadeval.data.words import first_of
from roadeval.errors import RoadevalError
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.score.fit import FitCheck
from roadeval.evaluation.score.frame import BlindPrior, score_finals
from roadeval.evaluation.score.scoreboard import Scoreboard
from roadeval.images.disturbing import Disturbance, Light
from roadeval.jobs.progress import OnProgress, Progress
from roadeval.jobs.run.frame import bind, external_layout, external_variant, run_variant
from roadeval.logs.errors import FrameError
from roadeval.logs.frames import FrameStream, LoggedFrame, Selection, merge_streams
from roadeval.logs.log import Log
from roadeval.logs.truth.named_labels import NamedLabels
from roadeval.logs.truth.picks import Picks
from roadeval.pipeline.chain import Chain
from roadeval.pipeline.stage import AbsentError, MisfitError, StageError, View
from roadeval.recording.layout import FOXGLOVE_TIME, HEADER_TIME, Layout
from roadeval.results.facts import focus_of
from roadeval.results.rows import Key, Row, condition_rows, csv_lines, doubt_rows, frame_rows
from roadeval.results.schema import STREAMED, TABLES
from roadeval.results.sentences import notes_of
from roadeval.runtime import discovery
from roadeval.runtime.files import sha256_of
from roadeval.runtime.memory import TRIM_EVERY, reuse, trim
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.threads import map_ordered
from roadeval.training import learning
from roadeval.training.learning import Schedule
from roadeval.training.model import Model
from roadeval.training.settings import TrainingSettings
from roadeval.version import VERSION

if TYPE_CHECKING:
    from roadeval.recording.recorder import Recorder

KEPT: Final = 5
"""Greatest number of tracebacks that are kept, each of another error; and of frames that are named
for an error."""
HOPELESS: Final = 10
TRIED: Final = (Role.EVALUATED, Role.UNLABELLED)
"""A run ends if all of the first `HOPELESS` frames of these roles fail."""
_NUMBER: Final = re.compile(r"(?<![:\d])\d+")
"""A number in a message, but not the line of a file."""


@dataclass(frozen=True)
class Failure:
    """A frame on which a stage failed. The error itself would hold the frame's images."""

    frame: int
    role: Role
    variant: str
    reason: str
    """The stage, and why it failed."""
    traceback: str


@dataclass(slots=True)
class Failures:
    """The frames on which a stage has failed so far, in their order, by variant and error."""

    by_error: dict[tuple[str, str], list[Failure]] = field(default_factory=dict)
    first: list[Failure] | None = field(default_factory=list)
    """The failures on frames of the roles `TRIED`; None as soon as such a frame did not fail."""

    def add(self, failure: Failure) -> None:
        """Note a frame; its traceback is kept if it is of one of the first different errors."""
        error = failure.variant, _NUMBER.sub("", failure.reason)
        failures = self.by_error.setdefault(error, [])
        with_traceback = not failures and len(self.by_error) <= KEPT
        failures.append(failure if with_traceback else replace(failure, traceback=""))
        if self.first is not None and failure.role in TRIED:
            self.first.append(failure)

    def tracebacks(self) -> tuple[str, ...]:
        """Return the tracebacks of the first few errors of stages."""
        return tuple(
            failures[0].traceback for failures in self.by_error.values() if failures[0].traceback
        )

    def sentences(self) -> Iterator[str]:
        """Yield a sentence for each error: the frames, the variant, the stage and why."""
        for failures in self.by_error.values():
            frames = first_of([str(failure.frame) for failure in failures], KEPT)
            where = f"{len(failures)} frames ({frames})" if len(failures) > 1 else f"frame {frames}"
            yield Sentence("{}: variant {}: {}", where, failures[0].variant, failures[0].reason)


SPARSE: Final = 5
"""If there are more than so many frames for each label, a note says so."""


@dataclass(frozen=True, eq=False)
class Run:
    """A prepared run: its frames, the chains that run on them, and the score so far."""

    log: Log
    config: RunConfig
    selection: Selection
    """The topics that are replayed, and why."""
    frames: FrameStream
    """The frames that are read, and the account of them."""
    variants: tuple[Variant, ...]
    model: Model
    schedule: Schedule
    """The frames that are not evaluated because the model learnt from them or from neighbours."""
    chains: Mapping[str, Chain]
    layouts: tuple[VariantLayout, ...]
    """Every variant that is scored, also variants with masks in the log."""
    methods: Mapping[str, Mapping[str, Any]]
    """Facts of stages beside their settings, by variant and stage. They are read before the first
    frame: a file that they name may be gone after the last."""
    board: Scoreboard
    fit: FitCheck
    """Whether truth and masks fit the images, as far as frames were added."""
    camera: str = ""
    """The camera's name in a rig; elsewhere its topic is its name."""
    failures: Failures = field(default_factory=Failures)
    """The frames on which a stage failed, so far."""

    @cached_property
    def disturbed_variants(self) -> tuple[str, ...]:
        """The variants that run on disturbed frames: all variants without masks from elsewhere."""
        return tuple(v.name for v in self.variants if "given" not in v.pipeline.settings)

    @cached_property
    def depth(self) -> Light | None:
        """The metres to the ground at each pixel, if the camera is known."""
        ground = self.selection.ground_as_read
        return ground.distances().astype("float32") if ground else None

    @property
    def key(self) -> Key:
        """Drive and camera, the first cells of every row of its tables."""
        return Key(self.log.name, self.camera or self.selection.image.name)

    @property
    def calibration(self) -> Calibration | None:
        """The camera's calibration, for frames as they are read."""
        calibration, size = self.selection.calibration, self.selection.size
        if (ground := self.selection.ground_as_read) and ground.is_posed:
            lens = ground.width, ground.height, ground.matrix, ground.model, ground.distortion
            if calibration is None:
                return Calibration("", *lens, self.key.camera.strip("/"))
            return Calibration(calibration.topic, *lens, calibration.frame_id, calibration.mounting)
        return calibration.scaled(*size) if calibration and size else None

    def add(self, done: ProcessedFrame) -> ProcessedFrame:
        """Add a frame in the camera's order; return it with the lines that depend on the order."""
        doubts = self.board.add(done.result)
        frame, variants = done.result.frame, done.result.variants
        final_masks = [[*v.masks()][-1][1] for v in variants if v.variant not in frame.external]
        self.fit.add(frame, final_masks)
        if done.result.role in TRIED:
            self.failures.first = None
        for failure in done.failures:
            self.failures.add(failure)
        rows = doubt_rows(done.result.frame, doubts)
        lines = self.csv_lines(rows | condition_rows(done.result, self.board.conditions.last))
        return replace(done, lines={**done.lines, **lines})

    def csv_lines(self, rows: Mapping[str, Iterable[Row]]) -> dict[str, str]:
        """Return the lines of CSV of the tables that have rows and are not left out."""
        without = self.config.output.without
        return csv_lines(self.key, {name: rows[name] for name in rows if name not in without})

    def layout(self) -> Layout:
        """Describe the recording before its first frame."""
        width, height = self.selection.size or (0, 0)
        of_foxglove = self.selection.image.schema.startswith("foxglove.")
        return Layout(
            self.log.name,
            width,
            height,
            self.layouts,
            tuple(METRICS),
            baseline=self.model.prior is not None,
            has_truth=self.selection.truth is not None,
            has_shadow_truth=self.selection.shadow is not None,
            disturbed={
                Disturbance.parse(text).name: self.disturbed_variants
                for text in self.config.frames.disturb
                if self.selection.truth
            },
            focus=self.board.unlabelled.focus,
            first_frame=self.schedule.first,
            rate_hz=self.selection.image.rate_hz,
            calibration=self.calibration,
            ground=self.selection.ground_as_read,
            extent=(*self.config.evaluation.plan, self.config.evaluation.plan_width),
            clouds=tuple(topic.name for topic in self.log.topics if topic.is_cloud),
            header_time=FOXGLOVE_TIME if of_foxglove else HEADER_TIME,
            tables={name: TABLES[name].header for name in STREAMED},
            properties={
                "version": VERSION,
                # The recording's identity comes from its layout, this digest included.
                "input": identity(self.log, self.config, self.selection.digests()),
                "drive": self.log.name,
                "preset": self.config.preset,
                "image_topic": self.selection.image.name,
                "truth_topic": self.selection.truth.where if self.selection.truth else "",
                "trained_on": self.model.source,
                "training_frames": len(self.model.digests),
            },
        )


def prepare(log: Log, config: RunConfig, on_progress: OnProgress, camera: str = "") -> Run:
    """Select the topics of a log, train or read the model, and bind the variants' chains.

    A `RoadevalError` if the log, the configuration or the training leave nothing to run. ``camera``
    is what the camera is called in a rig.
    """
    selection = log.select()
    read_frames = partial(log.frames, selection)
    variants = config.variants()
    picks = Picks.of_labels(Path(config.truth.path)) if config.truth.path else None
    if picks and selection.truth and isinstance(selection.truth.pictures, NamedLabels):
        picks.check(selection.truth.pictures)
    if picks and config.frames.scale != 1:
        raise RoadevalError("does not go with picked frames", setting="frames.scale")
    labelled = selection.truth is not None
    stream = read_frames()
    frames = len(stream)
    truths = frames if selection.truth is None else len(selection.truth.pictures)
    if frames > SPARSE * truths and picks is None:
        note = "at most {} of {} frames have road truth: {frames.labelled} reads these alone"
        on_progress(Progress(0, None, "opening", Sentence(note, truths, frames)))
    model, schedule = _learn(
        read_frames, variants, config.training, on_progress, labelled=labelled, picks=picks
    )
    try:
        chains = bind(variants, model)
    except MisfitError as error:
        raise RoadevalError.of(error, config.training.model) from error
    trim()
    layouts = [variant.layout() for variant in variants]
    for name, source in selection.masks.items():
        if name not in chains:
            layouts.append(external_layout(name, source.where, probable=source.is_confidence))
    prior = None if model.prior is None else BlindPrior(model.prior)
    names = [layout.name for layout in layouts]
    key = Key(log.name, camera or selection.image.name)
    chosen = config.output.focus
    # A camera of a rig may lack the masks that others have.
    focus = focus_of(names, chosen if chosen in names else None)
    ground = selection.ground_as_read
    board = Scoreboard(key, config.evaluation, names, prior, ground, focus=focus)
    return Run(
        log,
        config,
        selection,
        stream,
        variants,
        model,
        schedule,
        chains,
        tuple(layouts),
        {variant.name: about for variant in variants if (about := variant.pipeline.about())},
        board,
        FitCheck(selection.among_truth(stream.numbers), config.frames.every),
        camera,
    )


def _learn(
    frames: Callable[[], FrameStream],
    variants: tuple[Variant, ...],
    settings: TrainingSettings,
    on_progress: OnProgress,
    *,
    labelled: bool,
    picks: Picks | None,
) -> tuple[Model, Schedule]:
    pipelines = {variant.name: variant.pipeline for variant in variants}
    base = None
    if settings.model is not None:
        base, schedule = learning.from_file(Path(settings.model), pipelines)
        schedule = replace(schedule, picks=picks)
        if not settings.adapt:
            return base, schedule
    total = min(settings.frames, len(frames()))
    return learning.from_log(
        frames,
        pipelines,
        settings,
        lambda done: on_progress(Progress(done, total, "training")),
        labelled=labelled and settings.source != "patch",
        base=base,
        picks=picks,
    )


COMPUTING: Final = (
    *("numpy", "scipy", "scikit-learn", "onnxruntime"),
    *("av", "isal", "mcap", "pillow", "simplejpeg"),
)
"""The packages that decode and compute: another version may give other numbers."""


def deciding(config: RunConfig) -> RunConfig:
    """Return a configuration without settings that change no result: output paths and workers."""
    chosen = config.output
    output = OutputSettings(record=chosen.record, focus=chosen.focus, without=chosen.without)
    return replace(config, output=output, run=ExecutionSettings(), fleet=FleetSettings())


@cache
def computing() -> dict[str, str]:
    """Return the versions of the packages that compute, others' additions included."""
    import cv2

    packages = discovery.versions_of(COMPUTING)
    return {"opencv": cv2.__version__, **packages, **discovery.versions_of_additions()}


def software(config: RunConfig) -> dict[str, str]:
    """Return the versions of all that computes: roadeval, Python, packages, and others' stages.

    For a stage from outside roadeval it is the digest of its file. The processor, and how packages
    were compiled, are not included.
    """
    python = ".".join(platform.python_version_tuple()[:2])
    return {"roadeval": VERSION, "python": python, **computing(), **config.others_code()}


def identity(log: Log, config: RunConfig, masks: Mapping[str, str] | None = None) -> str:
    """Return a digest of the log, the settings, the model file and the software, in hexadecimal.

    It is equal for the same input, wherever log, model and masks lie. ``masks`` are the digests of
    the masks beside the log, by their variant. A `RoadevalError` if the disk of one of them fails.
    """
    model = config.training.model
    return settings_digest(config, sha256_of(Path(model)) if model else "", log.digest, masks or {})


def settings_digest(config: RunConfig, model: str, *more: Any) -> str:
    """Return a digest of settings, software, the SHA-256 of a model, and more, in hexadecimal."""
    masks = {name: replace(m, path="", images=None) for name, m in config.masks.items()}
    truth = replace(config.truth, path="", images=None)
    nowhere = "" if config.training.adapt else None  # the place of the file does not matter
    training = replace(config.training, model=nowhere)
    settings = deciding(config).without_places()
    output = replace(settings.output, focus=None)
    settings = replace(settings, training=training, masks=masks, truth=truth, output=output)
    text = json.dumps([settings.as_dict(), software(config), model, *more], sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


@dataclass(frozen=True, eq=False)
class ProcessedFrame:
    """A scored frame without its layers, its lines of the tables, and its encoded form.

    ``position`` counts all frames that were read, from 1, even if they cannot be decoded.
    """

    position: int
    result: FrameResult
    lines: Mapping[str, str]
    encoded: Any
    failures: Sequence[Failure] = ()
    """The variants that failed on its disturbed images."""


def process(
    runs: Sequence[Run], recorder: Recorder | None, on_progress: OnProgress
) -> Iterator[tuple[Run, ProcessedFrame]]:
    """Yield every decodable frame of the cameras by log time, and add it to its run's score.

    Decoding, computing, scoring and encoding happen in the worker threads.
    """
    reuse()
    total, read = sum(len(run.frames) for run in runs), Counter[int]()

    def numbered() -> Iterator[tuple[Run, int, LoggedFrame]]:
        """Yield each frame with its run, and its position among the frames of its camera."""
        for place, logged in merge_streams([run.frames for run in runs]):
            read[place] += 1
            yield runs[place], read[place], logged

    workers = runs[0].config.run.jobs or os.cpu_count() or 1
    work = partial(_process, recorder)
    for position, (run, done) in enumerate(map_ordered(work, numbered(), workers), 1):
        on_progress(Progress(position, total, "replaying"))
        if position % TRIM_EVERY == 0:
            trim()
        if isinstance(done, ProcessedFrame):
            yield run, run.add(done)
            continue
        run.board.lose()
        if done is not None:
            run.failures.add(done)
            if len(run.failures.first or ()) == HOPELESS:
                break
    for run in runs:
        if failures := run.failures.first:
            first, last = failures[0], failures[-1]
            names = [layout.name for layout in run.layouts if layout.name != first.variant]
            others = Sentence(" ").join(Sentence("{only} {}", name) for name in names)
            leave_out = Sentence("mend it, or leave the variant out with {}", others)
            frames = f"the first {len(failures)} frames ({first.frame} to {last.frame})"
            problem = Sentence("{}, on each of {}", first.reason, frames)
            where, remedy = f"variant {first.variant}", leave_out if names else "mend it"
            raise StageError(problem, where=where, remedy=remedy) from StageError(first.traceback)


def _process(
    recorder: Recorder | None, item: tuple[Run, int, LoggedFrame]
) -> tuple[Run, ProcessedFrame | Failure | None]:
    run, position, logged = item
    try:
        frame = replace(logged.decode(), camera=run.key.camera)
    except FrameError:
        return run, None  # the log's account has this frame, with the reason
    role = run.schedule.role(frame)
    if role is Role.UNLABELLED and frame.truth is not None:
        frame = replace(frame, truth=None, classes=None)  # its label is an unchanged proposal
    is_scored = role is Role.EVALUATED
    truths = {"truth": frame.truth, "shadow_truth": frame.shadow_truth} if is_scored else {}
    shared: dict[Any, Any] = {}
    view = View.of_frame(frame)
    variants = []
    for name, chain in run.chains.items():
        try:
            variant_result = run_variant(name, chain, view, **truths, known=shared)
        except AbsentError:
            continue
        except StageError as error:
            where = "".join(traceback.format_exception(error))
            return run, Failure(frame.number, role, name, error.sentence, where)
        variants.append(variant_result)
    variants += [
        external_variant(name, mask, frame.probabilities.get(name))
        for name, mask in frame.external.items()
        if name not in run.chains
    ]
    result = run.board.score(frame, role, tuple(variants))
    disturbed, failures = _disturb(run, frame) if is_scored else ({}, [])
    result = replace(result, notes=notes_of(result.tallies), disturbed=disturbed)
    lines = run.csv_lines(frame_rows(result))
    encoded = recorder.encode(result, position - 1) if recorder else None
    # Results wait for their turn; with their layers they would take some 15 bytes a pixel.
    return run, ProcessedFrame(position, result.without_layers(), lines, encoded, failures)


def _disturb(run: Run, frame: Frame) -> tuple[dict[str, FrameResult], list[Failure]]:
    """Run the chains on a frame's disturbed images; return the scored final masks, and failures."""
    results, failures = dict[str, FrameResult](), list[Failure]()
    assert frame.truth is not None
    for text in run.config.frames.disturb:
        image = Disturbance.parse(text).of(frame.image, frame.number, run.depth)
        view, shared, variants = View.of(image, frame.moment), dict[Any, Any](), []
        for name in run.disturbed_variants:
            try:
                *_, last = (s for s in run.chains[name].run(view, shared) if s.output.mask)
            except StageError as error:
                where = "".join(traceback.format_exception(error))
                reason = Sentence("{}: {}", text, error.sentence)
                failures.append(Failure(frame.number, Role.EVALUATED, name, reason, where))
                continue
            layers = tuple(a for a in last.output.layers if a.spec.name == last.stage)
            last = replace(last, output=replace(last.output, layers=layers))
            variants.append(VariantResult(name, (last,)))
        # The frame's file is of the undisturbed image, and the truth is recorded with that image.
        bare = replace(frame, image=image, media_type=None, truth=None, shadow_truth=None)
        result = FrameResult(bare, Role.EVALUATED, tuple(variants))
        results[text] = score_finals(result, frame.truth)
    return results, failures
