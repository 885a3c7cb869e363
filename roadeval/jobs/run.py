"""One run over one log: what was prepared for it, and the frames as they come out."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from roadeval import logs
from roadeval.config import RunConfig
from roadeval.data import FrameResult, Role, VariantLayout
from roadeval.evaluation.baselines import BlindPrior
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.scoreboard import Scoreboard
from roadeval.jobs import frame as runner
from roadeval.jobs.examples import ExampleFrames
from roadeval.jobs.progress import OnProgress, Progress
from roadeval.kernels import prepare
from roadeval.pipeline.chain import Chain
from roadeval.pipeline.stage import MisfitError, View
from roadeval.recording import Layout
from roadeval.results.lines import lines
from roadeval.results.schema import streamed
from roadeval.runtime.memory import TRIM_EVERY, trim
from roadeval.runtime.threads import ordered
from roadeval.training import Model, learning
from roadeval.training.model import ModelError
from roadeval.training.schedule import Schedule
from roadeval.version import VERSION

Processed = tuple[FrameResult, Mapping[str, str], Any]
"""A scored frame, its lines of the tables, and what the recorder made of it."""


class Encoder(Protocol):
    """Whatever turns a frame into what it will record, in any thread."""

    def encode(self, result: FrameResult, position: int, lines: Mapping[str, str]) -> Any:
        """Encode the frame at ``position`` among those read, from 0, with its table lines."""


class Run:
    """A log with its selection, its variants, what they have learnt, and the score so far.

    Parameters
    ----------
    log
        An open log.
    config
        Every option.
    on_progress
        Called with how far the run is.

    Raises
    ------
    RoadevalError
        If the log, the configuration or the training leave nothing to run.
    """

    def __init__(self, log: logs.Log, config: RunConfig, on_progress: OnProgress) -> None:
        self.log = log
        self.config = config
        self._tell = on_progress
        self.variants = config.variants()
        self.selection = log.select(config.topics, config.labels, scale=config.frames.scale)
        self.read = log.frames(self.selection, logs.Span.of(config.frames))
        self.total = len(self.read)
        self.model, self._schedule = self._learn()
        self._chains = self._bind()
        trim()
        prior = None if self.model.prior is None else BlindPrior(self.model.prior)
        names = [layout.name for layout in self._layouts()]
        self.board = Scoreboard(config.evaluation, names, prior)
        self.examples = ExampleFrames(self.total)
        self.done = 0

    def _learn(self) -> tuple[Model, Schedule]:
        settings = self.config.training
        if settings.model is not None:
            learnt = learning.from_file(Path(settings.model), self.config.pipelines())
            self._compile()
            return learnt
        self._compile()
        labelled = self.selection.truth is not None and settings.source != "patch"
        total = min(settings.frames, self.total)
        return learning.from_log(
            partial(self.log.frames, self.selection, logs.Span.of(self.config.frames)),
            self.config.pipelines(),
            settings,
            lambda done: self._tell(Progress(done, total, "training")),
            labelled=labelled,
        )

    def _compile(self) -> None:
        prepare(lambda: self._tell(Progress(0, self.total, "compiling")))

    def _bind(self) -> Mapping[str, Chain]:
        try:
            return runner.bind(self.variants, self.model)
        except MisfitError as error:
            raise ModelError(f"{self.config.training.model}: {error}") from error

    def layout(self) -> Layout:
        """Describe the recording before its first frame."""
        width, height = self.selection.size or (0, 0)
        return Layout(
            self.log.name,
            width,
            height,
            self._layouts(),
            tuple(METRICS),
            baseline=self.model.prior is not None,
            has_truth=self.selection.truth is not None,
            has_shadow_truth=self.selection.shadow is not None,
            first_frame=self._schedule.first,
            rate_hz=self.selection.image.rate_hz,
            tables={name: table.header for name, table in streamed().items()},
            properties=self._properties(),
        )

    def _layouts(self) -> tuple[VariantLayout, ...]:
        masks = self.selection.masks.items()
        external = (runner.external_layout(name, label.topic.name) for name, label in masks)
        return (*(variant.layout() for variant in self.variants), *external)

    def _properties(self) -> dict[str, str | int | float]:
        return {
            "version": VERSION,
            "drive": self.log.name,
            "preset": self.config.preset,
            "image_topic": self.selection.image.name,
            "truth_topic": self.selection.truth.topic.name if self.selection.truth else "",
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

        for processed in ordered(
            work, enumerate(self.read), self.config.run.jobs or os.cpu_count() or 1
        ):
            self.done += 1
            self._tell(Progress(self.done, self.total, "replaying"))
            if self.done % TRIM_EVERY == 0:
                trim()
            if processed is None:
                self.board.lose()
            else:
                self.board.add(processed[0])
                self.examples.offer(self.done, processed[0])
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
        own = lines(result)
        encoded = recorder.encode(result, position, own)
        # Results wait for their turn, and would wait with some 15 bytes a pixel.
        return result.without_layers(), own, encoded
