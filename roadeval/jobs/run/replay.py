"""The main job: a log goes in; a recording, tables and figures come out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from roadeval import logs
from roadeval.config import RunConfig, run_toml
from roadeval.data import FrameResult, Role
from roadeval.evaluation.comparison import Condition, Judgement
from roadeval.fleet import readable
from roadeval.jobs.outputs import Outputs
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.run import summary
from roadeval.jobs.run.prepared import Run, deciding, prepare, process
from roadeval.recording import NullRecorder, Recorder, RecordRule, recorder_for
from roadeval.report.images import ExampleFrame
from roadeval.results.comparison import judged
from roadeval.results.facts import Facts
from roadeval.results.folder import ResultsWriter
from roadeval.results.over_drives import check_conditions, judge_drives
from roadeval.results.rows import as_arrays, csv_lines, effect_rows, score_rows, sum_rows
from roadeval.results.schema import TABLES
from roadeval.runtime.files import AnyPath
from roadeval.runtime.memory import trim
from roadeval.version import VERSION

OnFrame = Callable[[FrameResult], None]


def pass_by(_result: FrameResult) -> None:
    """Do nothing with a frame."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a replay: where it lies, and its facts."""

    recording: Path | None
    reports: Path | None
    facts: Facts
    warnings: tuple[str, ...]
    losses: tuple[str, ...]
    files: tuple[Path, ...]
    tracebacks: tuple[str, ...] = ()
    """Where in their code stages failed that are among the losses."""
    rows: Mapping[str, Sequence[Mapping[str, Any]]] = field(default_factory=dict)
    """Those of the tables ``scores`` and ``effects``."""
    judgements: tuple[Judgement, ...] = ()
    """Of the conditions that were given."""

    @property
    def summary(self) -> dict[str, Any]:
        """The content of ``summary.json``."""
        return self.facts.as_dict()

    @property
    def held(self) -> list[str]:
        """The sentences of the conditions that hold."""
        return [judged(each) for each in self.judgements if each.holds]

    @property
    def unjudged(self) -> list[str]:
        """Why conditions could not be judged."""
        return [each.why for each in self.judgements if each.holds is None]


def replay(
    drive: AnyPath,
    config: RunConfig | None = None,
    *,
    save: AnyPath | None = None,
    reports: AnyPath | None = None,
    mcap: AnyPath | None = None,
    fail_if: Sequence[str] = (),
    on_progress: OnProgress = ignore,
    on_frame: OnFrame = pass_by,
) -> Outcome:
    """Replay a log through every variant; record, score and table every frame.

    Parameters
    ----------
    drive
        An MCAP file, or a rosbag2 folder of split files; or the URL of one, of which only the parts
        that are needed are read.
    config
        Every option; the defaults of ``roadeval replay`` otherwise. See `roadeval.configure` and
        `roadeval.load_config`.
    save, reports, mcap
        Where the recording, the folder of tables and figures, and the log of masks land; in place
        of what the configuration says.
    fail_if
        Conditions on a rate, as ``post.filtered.ERR > 20%``; see
        `roadeval.evaluation.comparison.conditions`.
    on_progress
        Called in the caller's thread after every frame, and where something else begins that takes
        its time.
    on_frame
        Called in the caller's thread with every frame in the drive's order: its image, truth, masks
        and counts, without the stages' other layers.

    Raises
    ------
    RoadevalError
        For whatever a user can mend: one line with what is wrong, where, and what to do.
    """
    conditions = [Condition.parse(text) for text in fail_if]
    check_conditions(conditions)
    given = {"save": save, "reports": reports, "mcap": mcap}
    wanted = {name: str(path) for name, path in given.items() if path is not None}
    config = (config or RunConfig()).for_drive(drive).override({"output": wanted}).resolved()
    with logs.open_log(readable(drive), config) as log:
        to = Outputs.of(config.output, log.name)
        with to.holding((drive, config.training.model)) as left:
            outcome = _written(log, config, to, on_progress, on_frame)
            warnings = (*outcome.warnings, *_unwritten(config, to))
            if left is not None:
                with suppress(OSError):
                    left.unlink()
                removed = f"removed {left}, the partial recording of an earlier run"
                warnings = (*warnings, f"{removed}: this one is whole")
    scores = [{"drive": log.name, **row} for row in outcome.rows["scores"]]
    judgements = judge_drives(scores, conditions, config.evaluation.least_frames)
    return replace(outcome, warnings=warnings, judgements=tuple(judgements))


def _written(
    log: logs.Log, config: RunConfig, to: Outputs, on_progress: OnProgress, on_frame: OnFrame
) -> Outcome:
    """Run over the log. All outputs are whole before the first of them takes its name."""
    run = prepare(log, config, on_progress)
    rule = RecordRule.parse(config.output.record)
    with (
        logs.SidecarWriter(to.mcap) if to.mcap else logs.NoSidecar() as sidecar,
        recorder_for(to.recording, run.layout(), rule) as recorder,
        ResultsWriter(to.reports) as results,
    ):
        examples = _record(
            run, recorder, results, sidecar, on_progress=on_progress, on_frame=on_frame
        )
        rows = sum_rows(run.board)
        sums = csv_lines(run.key, rows)
        results.append(sums)
        shown = [each.frame for each in examples]
        facts = summary.of(run, shown, results.tables)
        of_drive = {
            "scores": list(score_rows(facts, run.board.regions())),
            "effects": list(effect_rows(facts)),
        }
        tracebacks = run.failures.tracebacks()
        recorder.finish(_texts(run, facts, sums))
        sidecar.finish()
        del run  # figures take the room of its frames and models
        trim()
        if config.output.figures:
            from roadeval.report.figures import write_figures

            with results.explained():
                windows = as_arrays("windows", rows["windows"])
                write_figures(results.folder, log.name, windows, examples)
        facts = results.finish(facts, run_toml(config, log.name, VERSION))
    files = [to.reports / name for name in facts.files] + ([to.mcap] if to.mcap else [])
    return Outcome(
        *(to.recording, to.reports, facts, tuple(facts.warnings), tuple(facts.losses)),
        tuple(files),
        tracebacks=tracebacks,
        rows=of_drive,
    )


def _record(
    run: Run,
    recorder: Recorder | NullRecorder,
    results: ResultsWriter,
    sidecar: logs.SidecarWriter | logs.NoSidecar,
    *,
    on_progress: OnProgress,
    on_frame: OnFrame,
) -> list[ExampleFrame]:
    """Run over the frames; return those for the figure of masks."""
    examples = ExampleFrames(len(run.frames))
    for done in process(run, recorder, on_progress):
        if forecast := recorder.forecast(done.encoded, len(run.frames)):
            on_progress(Progress(done.position, len(run.frames), "replaying", forecast))
        recorder.write(done.encoded)
        results.append(done.lines)
        sidecar.write(done.result)
        examples.offer(done.position, done.result)
        on_frame(done.result)
    on_progress(Progress(len(run.frames), len(run.frames), "writing"))
    recorder.flush()
    trim()
    return examples.kept


def _texts(run: Run, facts: Facts, sums: Mapping[str, str]) -> dict[str, str]:
    """Return the results as the recording keeps them: the files' own text.

    What decides no number is left out, so that the same input gives the same recording.
    """
    config = deciding(run.config)
    return {
        "summary": replace(facts, run=config.as_dict()).text(),
        "run": run_toml(config, run.log.name, VERSION),
        **{name: TABLES[name].header + text for name, text in sums.items()},
    }


def _unwritten(config: RunConfig, to: Outputs) -> tuple[str, ...]:
    """Warn where a recording has a name but is not made."""
    if to.recording is not None or config.output.save is None:
        return ()
    return (f"`output.save` {config.output.save} is not written: `output.record` is none",)


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
