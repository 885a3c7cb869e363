"""``roadeval replay``: the main job at the terminal."""

from __future__ import annotations

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.options import Given, takes


@takes(
    *("output", "preset", "config", "variants", "nets", "masks", "tunes", "only"),
    *("training", "truth", "topics", "cameras", "ground", "labels", "frames", "run"),
)
def replay(
    drive: arguments.Drive,
    *,
    given: Given,
    json: arguments.Json = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Replay a log; record, score and plot every step.

    Every intermediate goes into a recording for the Rerun viewer. Where the log has truth, each
    stage is scored against it, with the shadow filter and without.
    """
    config = arguments.configuration(given)
    from roadeval.cli.screens import replay as screen
    from roadeval.jobs.run.replay import replay as run

    with progress.watched(quiet) as watch:
        found = run(drive, config, on_progress=watch)
    if json:
        console.emit(found.facts.text().rstrip())
    elif not quiet:
        screen.show(found, console.results())
    for text in found.tracebacks:
        messages.traceback(text)
    messages.loops_missing()
    for warning in found.warnings:
        messages.warning(warning)
    return messages.losses(found.losses)
