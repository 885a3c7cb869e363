"""``roadeval replay``: the main job at the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from roadeval.cli import arguments, console, messages, progress, streams
from roadeval.cli.options import Given, takes

if TYPE_CHECKING:
    from roadeval.config import RunConfig


@takes(
    *("output", "preset", "config", "variants", "nets", "masks", "tunes", "only"),
    *("training", "truth", "topics", "cameras", "ground", "labels", "frames", "run"),
)
def replay(
    drive: arguments.Drive,
    *,
    given: Given,
    fail_if: arguments.Conditions = None,
    json: arguments.Json = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Replay a log; record, score and plot every step.

    Every intermediate goes into a recording for the Rerun viewer. Where the log has truth, each
    stage is scored against it, with the shadow filter and without. Exit code 4 if a --fail-if
    condition holds on the drive; 1 if one cannot be judged. With --fail-if, limits and verdict are
    appended as Markdown to the file that $GITHUB_STEP_SUMMARY names.
    """
    config = arguments.configuration(given)
    from roadeval.cli.screens import replay as screen
    from roadeval.jobs.run.replay import replay as run

    _spare_pandas(config)
    with progress.watched(quiet) as watch:
        found = run(drive, config, fail_if=fail_if or (), on_progress=watch)
    if json:
        console.emit(found.facts.text().rstrip())
    elif not quiet:
        screen.show(found, console.results())
    if found.judgements:
        from roadeval.report.comparison import replayed

        console.to_step_summary(lambda: replayed(found.judgements, found.facts.verdict))
    for text in found.tracebacks:
        messages.traceback(text)
    messages.loops_missing()
    for warning in found.warnings:
        messages.warning(warning)
    return messages.conditions(found.held, found.unjudged, messages.losses(found.losses))


def _spare_pandas(config: RunConfig) -> None:
    """Let the recording be made without pandas, unless code of somebody else may need it."""
    if streams.taken_over() and config.output.record != "none" and not config.others_code():
        from roadeval.runtime.imports import leave_out_pandas

        leave_out_pandas()


COMMAND: Final = replay
