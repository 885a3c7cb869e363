"""The main job: a log goes in; a recording, tables and figures come out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.config.run import RunConfig, run_toml
from roadeval.data import TUNED, FrameResult, Role
from roadeval.data.words import short_names
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.score.scoreboard import DriveSums
from roadeval.evaluation.tables import concatenate, finals, only
from roadeval.fleet.remote import open_source
from roadeval.jobs.outputs import Outputs
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.run import summary
from roadeval.jobs.run.prepared import Run, deciding, prepare, process
from roadeval.logs.log import Log, Traffic, open_log
from roadeval.logs.writing.writer import SidecarWriter
from roadeval.recording.layout import RecordRule
from roadeval.report.images import ExampleFrame
from roadeval.results.facts import Facts, Origin
from roadeval.results.folder import ResultsWriter
from roadeval.results.rows import sum_rows
from roadeval.results.schema import TABLES
from roadeval.results.why import explain
from roadeval.runtime.files import AnyPath
from roadeval.runtime.memory import trim
from roadeval.runtime.repository import current_commit
from roadeval.runtime.sentence import Sentence
from roadeval.version import VERSION

if TYPE_CHECKING:
    from roadeval.recording.recorder import Recorder

OnFrame = Callable[[FrameResult], None]


@dataclass(frozen=True)
class Outcome:
    """The result of a replay: where it lies, and its facts."""

    recording: Path | None
    reports: Path | None
    facts: Facts
    warnings: tuple[str, ...]
    losses: tuple[str, ...]
    files: tuple[Path, ...]
    tracebacks: tuple[str, ...] = ()
    """Tracebacks of the stages that failed, which are among the losses."""
    metres: tuple[Mapping[str, Any], ...] = ()
    """The rows of ``metres``; empty for a rig, and if the camera is not known."""
    errors: tuple[float, ...] = ()
    """ERR of the focus frame by frame; empty for a rig."""
    traffic: Traffic | None = None
    """The requests and bytes for a log behind a URL; None for a log on a disk."""

    @property
    def summary(self) -> dict[str, Any]:
        """The content of ``summary.json``."""
        return self.facts.as_dict()


def replay(
    drive: AnyPath,
    config: RunConfig | None = None,
    *,
    save: AnyPath | None = None,
    reports: AnyPath | None = None,
    mcap: AnyPath | None = None,
    on_progress: OnProgress = ignore,
    on_frame: OnFrame = lambda _: None,
) -> Outcome:
    """Replay a log through every variant; record, score and table every frame.

    Parameters
    ----------
    drive
        An MCAP file, a rosbag2 folder of split files, or the URL of an MCAP file; only the parts of
        it that are needed are read.
    config
        Every option, by default as ``roadeval replay`` has it. See `roadeval.configure` and
        `roadeval.load_config`.
    save, reports, mcap
        Paths of the recording, of the folder of tables and figures, and of the log of masks, in
        place of those in the configuration.
    on_progress
        Called in the caller's thread after every frame, and when another long step begins.
    on_frame
        Called in the caller's thread with every frame in the drive's order: its image, truth, masks
        and counts, without the stages' other layers.

    Raises
    ------
    RoadevalError
        For any problem that a user can solve: one line with the problem, its place, and what to do.
    """
    places = {"save": save, "reports": reports, "mcap": mcap}
    places_given = {name: str(path) for name, path in places.items() if path is not None}
    config = (config or RunConfig()).for_drive(drive).override({"output": places_given}).resolved()
    config.check_focus(config.names())
    for variant in config.variants():
        if (about := variant.pipeline.about().get("net")) and not variant.name.endswith(TUNED):
            note = f"{variant.name}: {about['reading']}"
            on_progress(Progress(0, None, "opening", note))
    with open_log(open_source(drive, config.run.patience_s), config) as log:
        paths = Outputs.of(config.output, log.name)
        with paths.holding((drive, config.training.model)):
            outcome = _replay_log(log, config, paths, on_progress, on_frame)
            if paths.recording is None and (save := config.output.save) is not None:
                unwritten = "{output.save} {} is not written: {output.record} is none"
                return replace(outcome, warnings=(*outcome.warnings, Sentence(unwritten, save)))
            return outcome


def _replay_log(
    log: Log, config: RunConfig, paths: Outputs, on_progress: OnProgress, on_frame: OnFrame
) -> Outcome:
    """Run over the log. The outputs get their names when all of them are complete."""
    commit, cameras = current_commit(), config.by_camera()
    runs = [
        prepare(log.for_camera(camera_config) if name else log, camera_config, on_progress, name)
        for name, camera_config in cameras.items()
    ]
    with (
        SidecarWriter(paths.mcap) if paths.mcap else nullcontext() as sidecar,
        recorder_for(runs, paths.recording, config) as recorder,
        ResultsWriter(paths.reports, packed=config.output.packed) as results,
    ):
        drawn = _record_frames(
            runs, recorder, results, sidecar, on_progress=on_progress, on_frame=on_frame
        )
        ended = [_sum_up(run, results, drawn[run.camera]) for run in runs]
        facts = _finish_recording(runs, ended, recorder, results, config)
        if sidecar:
            sidecar.finish()
        tracebacks = tuple(text for run in runs for text in run.failures.tracebacks())
        del runs  # figures need the memory of its frames and models
        trim()
        if config.output.figures:
            from roadeval.report.figures import write_figures

            with results.explain_errors():
                names = short_names([*cameras])
                for camera, camera_result in zip(cameras, ended, strict=True):
                    windows, examples = camera_result.sums.windows, drawn[camera]
                    write_figures(results.folder, log.name, windows, examples, names[camera])
        facts = replace(facts, origin=Origin(time.time_ns(), *commit, {**config.output.labels}))
        facts = results.finish(facts, run_toml(config, log.name, VERSION))
    of_focus = finals(only(ended[0].sums.frames, variant=facts.focus or ""))
    files = [paths.reports / name for name in facts.files] + ([paths.mcap] if paths.mcap else [])
    return Outcome(
        *(paths.recording, paths.reports, facts, tuple(facts.warnings), tuple(facts.losses)),
        tuple(files),
        tracebacks=tracebacks,
        metres=ended[0].metres if len(ended) == 1 else (),
        errors=tuple(of_focus[TESTED].dropna()) if len(ended) == 1 else (),
        traffic=log.traffic,
    )


@dataclass(frozen=True, eq=False)
class _CameraResult:
    """The results of a camera's run."""

    facts: Facts
    sums: DriveSums
    texts: Mapping[str, str]
    """Texts of its results, as the recording keeps them."""
    metres: tuple[Mapping[str, Any], ...]


def _sum_up(run: Run, results: ResultsWriter, examples: Sequence[ExampleFrame]) -> _CameraResult:
    """Sum up a camera's run, and add the sums to the tables."""
    import pandas as pd

    sums = run.board.summary(run.selection.classes)
    rows = sum_rows(run.board, sums.windows, run.selection.classes)
    lines = run.csv_lines(rows)
    results.append(lines)
    example_numbers = [example.frame for example in examples]
    facts = summary.make_facts(run, sums, example_numbers, {} if run.camera else results.tables)
    of_classes = [(*run.key, *row) for row in rows["classes"]]
    classes = pd.DataFrame(of_classes, columns=[*TABLES["classes"].names])
    facts = replace(facts, why=explain(facts, classes))
    return _CameraResult(facts, sums, _recorded_texts(run, facts, lines), tuple(run.board.metres()))


def recorder_for(
    runs: Sequence[Run], path: Path | None, config: RunConfig
) -> AbstractContextManager[Recorder | None]:
    """Return the recorder of some runs; None without a path, so that Rerun is not imported."""
    if path is None:
        return nullcontext()
    from roadeval.recording.recorder import Recorder

    layouts = {run.camera: run.layout() for run in runs}
    return Recorder(path, layouts, RecordRule.parse(config.output.record))


def _finish_recording(
    runs: Sequence[Run],
    ended: Sequence[_CameraResult],
    recorder: Recorder | None,
    results: ResultsWriter,
    config: RunConfig,
) -> Facts:
    """Finish the recording, and return the facts of all cameras together."""
    if len(runs) == 1:
        if recorder:
            recorder.finish(ended[0].texts)
        return ended[0].facts
    by_camera = {run.camera: camera_result for run, camera_result in zip(runs, ended, strict=True)}
    frames = concatenate([camera_result.sums.frames for camera_result in ended])
    disturbed = concatenate([camera_result.sums.disturbed for camera_result in ended])
    camera_facts = {name: camera_result.facts for name, camera_result in by_camera.items()}
    facts = summary.join_cameras(frames, disturbed, camera_facts, results.tables)
    if recorder is None:
        return facts
    # The seconds differ from run to run, see `_recorded_texts`.
    steady = {name: replace(facts, seconds={}) for name, facts in camera_facts.items()}
    recorded = replace(facts, run=deciding(config).as_dict(), cameras=steady)
    toml = run_toml(deciding(config), facts.drive.name, VERSION)
    texts = {name: camera_result.texts for name, camera_result in by_camera.items()}
    recorder.finish({"summary": recorded.text(), "run": toml}, by_camera=texts)
    return facts


def _record_frames(
    runs: Sequence[Run],
    recorder: Recorder | None,
    results: ResultsWriter,
    sidecar: SidecarWriter | None,
    *,
    on_progress: OnProgress,
    on_frame: OnFrame,
) -> dict[str, list[ExampleFrame]]:
    """Run over the frames; return the frames for the figure of masks, by camera."""
    examples = {run.camera: ExampleFrames(len(run.frames)) for run in runs}
    total = sum(len(run.frames) for run in runs)
    for position, (run, done) in enumerate(process(runs, recorder, on_progress), 1):
        if recorder:
            if forecast := recorder.forecast(done.encoded, total):
                on_progress(Progress(position, total, "replaying", forecast))
            recorder.write(done.encoded, done.lines)
        results.append(done.lines)
        if sidecar:
            sidecar.write(done.result, run.selection.image.frame_id, run.camera)
        examples[run.camera].offer(done.position, done.result)
        on_frame(done.result)
    on_progress(Progress(total, total, "writing"))
    if recorder:
        recorder.flush()
    trim()
    return {camera: camera_examples.kept for camera, camera_examples in examples.items()}


def _recorded_texts(run: Run, facts: Facts, sums: Mapping[str, str]) -> dict[str, str]:
    """Return the results as the recording keeps them: the files' own text.

    Settings that change no number are left out, so that the same input gives the same recording.
    """
    config = deciding(run.config)
    return {
        "summary": replace(facts, run=config.as_dict()).text(),
        "run": run_toml(config, run.log.name, VERSION),
        **{name: TABLES[name].header + text for name, text in sums.items()},
    }


SHOWN: Final = 4


class ExampleFrames:
    """Keeps a few frames that are spread evenly over a drive of ``total`` frames."""

    def __init__(self, total: int) -> None:
        self._due = [total * (2 * i + 1) / (2 * SHOWN) for i in range(SHOWN)]
        self.kept: Final[list[ExampleFrame]] = []

    def offer(self, position: int, result: FrameResult) -> None:
        """Keep the frame at ``position`` (from 1) if one is due and it is not a training frame."""
        if not self._due or position < self._due[0]:
            return
        if result.role in (Role.TRAINING, Role.COPY, Role.GAP):
            return
        self._due.pop(0)
        frame = result.frame
        masks = {v.variant: v.final() for v in result.variants}
        self.kept.append(ExampleFrame(frame.number, frame.image, frame.truth, masks).small())
