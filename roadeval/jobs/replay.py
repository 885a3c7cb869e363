"""The main job: a log goes in; a recording, tables and figures come out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from roadeval import logs
from roadeval.config import RunConfig
from roadeval.config.toml import run_toml
from roadeval.jobs import summary
from roadeval.jobs.examples import ExampleFrames
from roadeval.jobs.identity import deciding
from roadeval.jobs.outputs import AnyPath, Outputs, keep_apart
from roadeval.jobs.processing import process
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.run import Run, prepare
from roadeval.recording import NullRecorder, RecordRule, recorder_for
from roadeval.report.figures.figure import ExampleFrame, FigureData
from roadeval.report.figures.files import write_figures
from roadeval.results.folder import ResultsFolder, ResultsWriter
from roadeval.results.lines import sum_lines
from roadeval.results.schema import TABLES
from roadeval.results.summary import summary_text
from roadeval.runtime.memory import trim
from roadeval.version import VERSION


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a replay: where it lies, and the content of ``summary.json``."""

    recording: Path | None
    reports: Path | None
    summary: dict[str, Any]
    warnings: tuple[str, ...]
    losses: tuple[str, ...]
    files: tuple[Path, ...]


def replay(
    drive: AnyPath,
    config: RunConfig | None = None,
    *,
    save: AnyPath | None = None,
    reports: AnyPath | None = None,
    mcap: AnyPath | None = None,
    on_progress: OnProgress = ignore,
) -> Outcome:
    """Replay a log through every variant; record, score and table every frame.

    Parameters
    ----------
    drive
        An MCAP file, or a rosbag2 folder of split files.
    config
        Every option; the defaults of ``roadeval replay`` otherwise. See `roadeval.configure` and
        `roadeval.load_config`.
    save, reports, mcap
        Where the recording, the folder of tables and figures, and the log of masks land; in place
        of what the configuration says.
    on_progress
        Called in the caller's thread after every frame, and where something else begins that takes
        its time.

    Raises
    ------
    RoadevalError
        For whatever a user can mend: one line with what is wrong, where, and what to do.
    """
    given = {"save": save, "reports": reports, "mcap": mcap}
    wanted = {name: str(path) for name, path in given.items() if path is not None}
    config = (config or RunConfig()).for_drive(drive).override({"output": wanted})
    with logs.open_log(drive, keep_corrupt=config.frames.keep_corrupt) as log:
        to = Outputs.of(config.output, log.name)
        keep_apart((drive, config.training.model), (to.recording, to.mcap))
        outcome, examples = _run(log, config, to, on_progress)
        # The run's frames and models are released here: figures take their room.
        trim()
        windows = ResultsFolder(to.reports).windows
        figures = write_figures(to.reports, FigureData(log.name, windows, examples))
        return replace(outcome, files=(*outcome.files, *figures))


def _run(
    log: logs.Log, config: RunConfig, to: Outputs, on_progress: OnProgress
) -> tuple[Outcome, list[ExampleFrame]]:
    """Run over the log into a recording and tables; return the frames for the figure of masks."""
    sidecar = logs.SidecarWriter(to.mcap) if to.mcap else logs.NoSidecar()
    with ResultsWriter(to.reports) as results, sidecar:
        run = prepare(log, config, on_progress)
        examples = ExampleFrames(len(run.frames))
        rule = RecordRule.parse(config.output.record)
        with recorder_for(to.recording, run.layout(), rule) as recorder:
            for done in process(run, recorder, on_progress):
                recorder.write(done.encoded)
                results.append(done.lines)
                sidecar.write(done.result)
                examples.offer(done.position, done.result)
            on_progress(Progress(len(run.frames), len(run.frames), "writing"))
            recorder.flush()
            trim()
            sums = sum_lines(run.board.sums())
            results.append(sums)
            facts = summary.of(run) | {"tables": results.tables}
            recorder.finish(_texts(run, facts, sums))
            files = results.finish(facts, run_toml(config, log.name, VERSION))
    saved = None if isinstance(recorder, NullRecorder) else recorder.path
    files += [sidecar.path] if sidecar.path else []
    warnings, losses = summary.warnings(run), summary.losses(run)
    return Outcome(saved, to.reports, facts, warnings, losses, tuple(files)), examples.kept


def _texts(run: Run, facts: Mapping[str, Any], sums: Mapping[str, str]) -> dict[str, str]:
    """Return the results as the recording keeps them: the files' own text.

    What decides no number is left out, so that the same input gives the same recording.
    """
    config = deciding(run.config)
    return {
        "summary": summary_text({**facts, "run": config.as_dict()}),
        "run": run_toml(config, run.log.name, VERSION),
        **{name: TABLES[name].header + text for name, text in sums.items()},
    }
