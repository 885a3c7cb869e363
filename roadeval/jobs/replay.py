"""The main job: a log goes in; a recording, tables and figures come out."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from roadeval import logs
from roadeval.evaluation import metrics
from roadeval.jobs.options import Outcome, Progress, ReplayOptions, keep_apart
from roadeval.jobs.run import Run
from roadeval.recording import NullRecorder, Rule, recorder_for
from roadeval.report.figures.figure import ExampleFrame, FigureData
from roadeval.report.figures.files import write_figures
from roadeval.results.folder import Results, ResultsWriter, summary_text
from roadeval.results.tables import header
from roadeval.runtime.memory import give_back

__all__ = ["Outcome", "Progress", "ReplayOptions", "replay"]


def replay(
    drive: str | Path,
    *,
    save: str | Path | None = None,
    reports: str | Path | None = None,
    mcap: str | Path | None = None,
    options: ReplayOptions | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> Outcome:
    """Replay a log through every variant; record, score and table every frame.

    Parameters
    ----------
    drive
        An MCAP file, or a rosbag2 folder of split files.
    save
        The recording; ``recordings/<drive>.rrd`` by default.
    reports
        The folder of tables and figures; ``reports/<drive>/`` by default.
    mcap
        A log for masks, error maps and rates, with the images' own times; none by default.
    options
        Everything else.
    on_progress
        Called in the caller's thread after every frame, and where something else begins that takes
        its time.

    Returns
    -------
    Outcome
        What was written, and the summary.

    Raises
    ------
    RoadevalError
        For whatever a user can mend: one line that says what, where, and what to do.
    """
    options, tell = options or ReplayOptions(), on_progress or _silent
    rule = Rule.parse(options.record)
    options.check_sidecar(mcap)
    with logs.open_log(drive, keep_corrupt=options.keep_corrupt) as log:
        path = Path(save or Path("recordings", f"{log.name}.rrd"))
        folder = Path(reports or Path("reports", log.name))
        keep_apart((drive, options.model), (path, mcap))
        outcome, examples = _run(log, _Outputs(path, rule, folder, mcap), options, tell)
        # What the run has learnt and held is gone: figures take its room.
        give_back()
        figures = write_figures(folder, FigureData(log.name, Results(folder).windows, examples))
        return replace(outcome, files=(*outcome.files, *figures))


class _Outputs(NamedTuple):
    """Where a run writes, and whose pictures it records."""

    recording: Path
    rule: Rule
    reports: Path
    mcap: str | Path | None


def _run(
    log: logs.Log, to: _Outputs, options: ReplayOptions, tell: Callable[[Progress], None]
) -> tuple[Outcome, list[ExampleFrame]]:
    """Run over the log into a recording and tables; give the frames for the figure of masks."""
    with (
        ResultsWriter(to.reports) as results,
        _sidecar(to.mcap) as sidecar,
        ExitStack() as opened,
    ):
        run = Run(log, options, tell)
        recorder = recorder_for(to.recording, run.layout(), to.rule)
        opened.enter_context(recorder)
        for result, encoded in run.frames(recorder):
            recorder.write(encoded)
            results.append(result)
            sidecar.write(result)
        tell(Progress(run.done, run.total, "writing"))
        recorder.settle()
        give_back()
        sums, summary = run.board.tables(), run.summary()
        recorder.finish(_texts(summary, sums))
        files = results.finish(summary, sums)
    saved = None if isinstance(recorder, NullRecorder) else recorder.path
    files += [sidecar.path] if sidecar.path else []
    outcome = Outcome(saved, to.reports, summary, run.warnings(), run.losses(), tuple(files))
    return outcome, run.examples.kept


def _sidecar(path: str | Path | None) -> logs.SidecarWriter | logs.NoSidecar:
    return logs.NoSidecar() if path is None else logs.SidecarWriter(path, metrics.of)


def _texts(summary: dict[str, Any], sums: dict[str, str]) -> dict[str, str]:
    """Give the results as the recording keeps them: the files' own text."""
    tables = {name: header(name) + text for name, text in sums.items()}
    return {"summary": summary_text(summary), **tables}


def _silent(_progress: Progress) -> None:
    """Tell nobody."""
