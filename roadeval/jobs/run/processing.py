"""The frames of a run, decoded, computed, scored and encoded in worker threads."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

from roadeval import logs
from roadeval.data import FrameResult, Role
from roadeval.jobs.progress import OnProgress, Progress
from roadeval.jobs.run import frame as one_frame
from roadeval.jobs.run.prepared import Run
from roadeval.pipeline.stage import StageError, View
from roadeval.results.rows import csv_lines, frame_rows
from roadeval.results.sentences import notes_of
from roadeval.runtime.memory import TRIM_EVERY, trim
from roadeval.runtime.threads import ordered


class Encoder(Protocol):
    """The part of a recorder that encodes a frame; called from any thread."""

    def encode(self, result: FrameResult, position: int, lines: Mapping[str, str]) -> Any:
        """Encode the frame at ``position`` among those read, from 0, with its table lines."""


@dataclass(frozen=True, slots=True, eq=False)
class ProcessedFrame:
    """A scored frame without its layers, its lines of the tables, and its encoded form.

    ``position`` counts the frames that were read, from 1, those included that cannot be decoded.
    ``beside`` are the training frames of a model file that show the same place.
    """

    position: int
    result: FrameResult
    lines: Mapping[str, str]
    encoded: Any
    beside: frozenset[int]


def process(run: Run, encoder: Encoder, on_progress: OnProgress) -> Iterator[ProcessedFrame]:
    """Yield every decodable frame in order, and add it to the run's score.

    Decoding, computing, scoring and encoding happen in the worker threads.
    """
    total, workers = len(run.frames), run.config.run.jobs or os.cpu_count() or 1
    work = partial(_process, run, encoder)
    for position, done in enumerate(ordered(work, enumerate(run.frames, 1), workers), 1):
        on_progress(Progress(position, total, "replaying"))
        if position % TRIM_EVERY == 0:
            trim()
        if done is None:
            run.board.lose()
        else:
            run.board.add(done.result)
            run.beside.update(done.beside)
            yield done


def _process(
    run: Run, encoder: Encoder, item: tuple[int, logs.LoggedFrame]
) -> ProcessedFrame | None:
    position, logged = item
    try:
        frame = replace(logged.decode(), camera=run.key.camera)
    except logs.FrameError:
        return None  # the log's accounting has it, with the reason
    use = run.schedule.use(frame)
    known = (frame.truth, frame.shadow_truth) if use.role is Role.EVALUATED else (None, None)
    shared: dict[Any, Any] = {}
    view = View.of(frame.image, frame.moment)
    try:
        variants = [
            one_frame.run_variant(
                name,
                chain,
                view,
                truth=known[0],
                shadow_truth=known[1],
                known=shared,
                repeats={seed: chains[name] for seed, chains in run.repeats.items()},
            )
            for name, chain in run.chains.items()
        ]
    except StageError as error:
        run.failures.add(frame.number, error)
        return None
    variants += [
        one_frame.external_variant(name, mask, frame.probabilities.get(name))
        for name, mask in frame.external.items()
    ]
    result = run.board.score(frame, use.role, tuple(variants))
    result = replace(result, notes=notes_of(result.tallies))
    own = csv_lines(run.key, frame_rows(result))
    encoded = encoder.encode(result, position - 1, own)
    # Results wait for their turn, and would wait with some 15 bytes a pixel.
    return ProcessedFrame(position, result.without_layers(), own, encoded, use.beside)
