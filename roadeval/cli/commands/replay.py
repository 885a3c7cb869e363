"""``roadeval replay``: one log in, a recording, tables and figures out."""

from __future__ import annotations

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.options import OptionValues, takes


@takes(
    *("output", "preset", "config", "variants", "nets", "masks", "tunes", "only"),
    *("training", "truth", "topics", "cameras", "ground", "labels", "frames", "run"),
)
def replay(
    drive: arguments.Drive,
    *,
    options: OptionValues,
    json: arguments.Json = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Replay a log, and record, score and plot every step.

        roadeval replay drive.mcap
        roadeval replay drive.mcap --truth labels/ --net mine=net.onnx
        roadeval replay drive.mcap --variant robust --save robust.rrd

    Every intermediate result goes into a recording for the Rerun viewer. If the log has truth, each
    stage is scored against it, with the shadow filter and without.
    """
    config = arguments.configuration(options)
    from roadeval.cli.screens import replay as screen
    from roadeval.jobs.run.replay import replay as run

    with progress.show(quiet) as watch:
        outcome = run(drive, config, on_progress=watch)
    if json:
        console.emit(outcome.facts.text().rstrip())
    elif not quiet:
        screen.show(outcome, console.results())
    for text in outcome.tracebacks:
        messages.traceback(text)
    messages.warn_of_missing_loops()
    for warning in outcome.warnings:
        messages.warning(warning)
    if not (json or quiet):
        screen.show_verdict(outcome.facts, console.results())
    return messages.losses(outcome.losses)
