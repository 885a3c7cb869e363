"""One run over one log: what was prepared for it, and the frames as they come out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Protocol

from roadeval import logs
from roadeval.config import Variant, pipelines_of
from roadeval.data import FrameResult, Role, VariantLayout
from roadeval.evaluation.baselines import BlindPrior
from roadeval.evaluation.scoreboard import Scoreboard
from roadeval.jobs import frame as runner
from roadeval.jobs import provenance
from roadeval.jobs.gallery import Gallery
from roadeval.jobs.options import OptionError, Progress, ReplayOptions
from roadeval.kernels import prepare
from roadeval.pipeline.chain import Chain
from roadeval.pipeline.stage import MisfitError, View
from roadeval.recording import Layout
from roadeval.results import tables
from roadeval.results.folder import STREAMED
from roadeval.runtime.memory import OFTEN, give_back
from roadeval.runtime.threads import ordered
from roadeval.training import Model, learning
from roadeval.training.model import ModelError
from roadeval.training.schedule import Schedule

Tell = Callable[[Progress], None]
Processed = tuple[FrameResult, Any]
"""A scored frame, and what the recorder made of it."""


class Encoder(Protocol):
    """Whatever turns a frame into what it will record, in any thread."""

    def encode(self, result: FrameResult, position: int) -> Any:
        """Encode the frame at ``position`` among those read, from 0."""


class Run:
    """A log with its selection, its variants, what they have learnt, and the score so far.

    Parameters
    ----------
    log
        An open log.
    options
        What was asked for.
    tell
        Told how far the run is.

    Raises
    ------
    RoadevalError
        If the log, the options or the training leave nothing to run.
    """

    def __init__(self, log: logs.Log, options: ReplayOptions, tell: Tell) -> None:
        self.log = log
        self._options = options
        self._tell = tell
        self._jobs = options.workers()
        self._variants: tuple[Variant, ...] = options.all_variants()
        self._selection = options.select(log)
        self._frames = log.frames(self._selection, options.span())
        self.total = len(self._frames)
        self.model, self._schedule = self._learn()
        self._chains = self._bind()
        give_back()
        prior = None if self.model.prior is None else BlindPrior(self.model.prior)
        names = [layout.name for layout in self._layouts()]
        self.board = Scoreboard(options.config.evaluation, names, prior)
        self.gallery = Gallery(self.total)
        self.done = 0

    def _learn(self) -> tuple[Model, Schedule]:
        options, settings = self._options, self._options.training()
        if options.model is not None:
            if options.train_frames is not None or options.train_gap is not None:
                raise OptionError("--train-frames and --train-gap do not go with --model")
            learnt = learning.from_file(options.model, pipelines_of(self._variants))
            self._compile()
            return learnt
        self._compile()
        labelled = self._selection.truth is not None and settings.source != "patch"
        total = min(settings.frames, self.total)
        return learning.from_log(
            partial(self.log.frames, self._selection, options.span()),
            pipelines_of(self._variants),
            settings,
            lambda done: self._tell(Progress(done, total, "training")),
            labelled=labelled,
        )

    def _compile(self) -> None:
        prepare(lambda: self._tell(Progress(0, self.total, "compiling")))

    def _bind(self) -> Mapping[str, Chain]:
        try:
            return runner.bind(self._variants, self.model)
        except MisfitError as error:
            raise ModelError(f"{self._options.model}: {error}") from error

    def layout(self) -> Layout:
        """Describe the recording before its first frame."""
        width, height = self._selection.size or (0, 0)
        return Layout(
            self.log.name,
            width,
            height,
            self._layouts(),
            baseline=self.model.prior is not None,
            has_truth=self._selection.truth is not None,
            has_shadow_truth=self._selection.shadow is not None,
            first_frame=self._schedule.first,
            rate_hz=self._selection.image.rate_hz,
            tables={name: tables.header(name) for name in STREAMED},
            properties=self._properties(),
        )

    def _layouts(self) -> tuple[VariantLayout, ...]:
        masks = self._selection.masks.items()
        external = (runner.external_layout(name, label.topic.name) for name, label in masks)
        return (*(variant.layout() for variant in self._variants), *external)

    def _properties(self) -> dict[str, str | int | float]:
        return {
            "version": provenance.versions()["roadeval"],
            "drive": self.log.name,
            "preset": self._options.config.preset,
            "image_topic": self._selection.image.name,
            "truth_topic": self._selection.truth.topic.name if self._selection.truth else "",
            "trained_on": self.model.source,
            "training_frames": len(self.model.digests),
        }

    def frames(self, recorder: Encoder) -> Iterator[Processed]:
        """Yield every decodable frame in order, scored and encoded for the recorder.

        Decoding, computing, scoring and encoding happen in the worker threads. The layers are
        the recorder's alone: a yielded result has none.
        """

        def work(item: tuple[int, logs.LoggedFrame]) -> Processed | None:
            return self._process(*item, recorder)

        for processed in ordered(work, enumerate(self._frames), self._jobs):
            self.done += 1
            self._tell(Progress(self.done, self.total, "replaying"))
            if self.done % OFTEN == 0:
                give_back()
            if processed is None:
                self.board.lose()
            else:
                self.board.add(processed[0])
                self.gallery.look(self.done, processed[0])
                yield processed

    def _process(
        self, position: int, logged: logs.LoggedFrame, recorder: Encoder
    ) -> Processed | None:
        try:
            frame = logged.decode()
        except logs.FrameError:
            return None  # it stands in the log's accounting, with the reason
        role = self._schedule.role(frame)
        known = (frame.truth, frame.shadow_truth) if role is Role.EVALUATED else (None, None)
        shared: dict[Any, Any] = {}
        seen = View.of(frame.image)
        variants = [
            runner.run_variant(
                name,
                chain,
                seen,
                truth=known[0],
                shadow_truth=known[1],
                known=shared,
            )
            for name, chain in self._chains.items()
        ]
        variants += [runner.external_variant(name, mask) for name, mask in frame.external.items()]
        result = self.board.score(frame, role, tuple(variants))
        encoded = recorder.encode(result, position)
        # Results wait for their turn, and would wait with some 15 bytes a pixel.
        return result.without_layers(), encoded

    def summary(self) -> dict[str, Any]:
        """Give the content of ``summary.json``, but for its format."""
        return self.board.summary() | {
            "drive": self._drive(),
            "frames": self._accounting(),
            "training": self._training(),
            "warnings": list(self.warnings()),
            "losses": list(self.losses()),
            "selection": provenance.selection(self._options),
            "settings": provenance.settings(
                self._variants, self._options.training(), self._options.config.evaluation
            ),
            "versions": provenance.versions(),
            "log": {"path": str(self.log.path), "sha256": self.log.sha256()},
        }

    def warnings(self) -> tuple[str, ...]:
        """Say what a user should know before believing the results."""
        unlabelled = (
            ()
            if self._selection.truth
            else ("the log has no road truth: there is nothing to score, only masks to look at",)
        )
        return (
            *unlabelled,
            *self._sizes(),
            *self._unheeded(),
            *self._near_training(),
            *self.model.warnings,
        )

    def _sizes(self) -> tuple[str, ...]:
        """Say whether the frames are not the camera's own, or not of the model's size."""
        told = []
        if self._options.scale != 1 and self._selection.image.size:
            width, height = self._selection.image.size
            told.append(
                f"the frames, {width}x{height} in the log, are reduced to "
                f"{self._options.scale:g} of it: the numbers are not those of full frames"
            )
        prior = self.model.prior
        if self._options.model is not None and prior is not None and self._selection.size:
            width, height = self._selection.size
            if prior.shape != (height, width):
                told.append(
                    f"the model learnt from frames of {prior.shape[1]}x{prior.shape[0]}, and these "
                    f"are {width}x{height}: texture and sizes in pixels mean something else there"
                )
        return tuple(told)

    def _near_training(self) -> tuple[str, ...]:
        """Say whether frames next to those that trained a model file are evaluated."""
        roles = Counter(self.board.roles())
        own = roles[Role.TRAINING]
        if self._options.model is None or not own or not roles[Role.EVALUATED]:
            return ()
        return (
            f"{own} of the model's {len(self.model.digests)} training frames lie in this drive; "
            "their neighbours are evaluated and look alike, which flatters the result: use a "
            "model of other drives",
        )

    def _unheeded(self) -> tuple[str, ...]:
        """Say which variants ask for a training or a scoring that is not this run's."""
        config = self._options.config
        return tuple(
            f"{variant.name}: its own [{room}] is not followed: all variants of a run are trained "
            "and scored alike, as --preset, --config and the options say"
            for variant in self._variants
            for room in ("training", "evaluation")
            if getattr(variant.config, room) != getattr(config, room)
        )

    def losses(self) -> tuple[str, ...]:
        """Say which parts of the log were lost."""
        frames = sorted(self._frames.accounting.undecodable.items())
        return (*self.log.losses, *(f"frame {number}: {reason}" for number, reason in frames))

    def _drive(self) -> dict[str, Any]:
        width, height = self._selection.size or (0, 0)
        return {
            "name": self.log.name,
            "width": width,
            "height": height,
            "rate_hz": self._selection.image.rate_hz,
            "topics": list(self._selection.reasons),
        }

    def _accounting(self) -> dict[str, Any]:
        """Account for every frame of the image topic: evaluated, or skipped and why."""
        seen, roles = self._frames.accounting, Counter(self.board.roles())
        skipped = {
            "outside the range": seen.in_log - seen.in_range,
            "not read (--every, --max-frames)": seen.in_range - seen.read,
            "undecodable": len(seen.undecodable),
            "trained on": roles[Role.TRAINING],
            "gap after training": roles[Role.GAP],
            "unlabelled": roles[Role.UNLABELLED],
        }
        return {
            "in_log": seen.in_log,
            "read": seen.read,
            "decoded": seen.read - len(seen.undecodable),
            "labelled": seen.labelled,
            "trained_on": roles[Role.TRAINING],
            "evaluated": roles[Role.EVALUATED],
            "skipped": {reason: number for reason, number in skipped.items() if number},
        }

    def _training(self) -> dict[str, Any]:
        return {
            "source": self.model.source,
            "frames": len(self.model.digests),
            "pixels": self.model.pixels,
            "model": None if self._options.model is None else str(self._options.model),
        }
