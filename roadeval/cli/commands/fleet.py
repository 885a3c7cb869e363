"""``roadeval fleet``: many drives in one run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import OptionValues, takes

Drives = Annotated[
    list[str],
    arguments.argument(
        "DRIVE...",
        "Logs, rosbag2 folders, folders to search, patterns, URLs, or manifests (.toml).",
    ),
]


@takes(
    *("preset", "config", "variants", "nets", "masks", "tunes", "only", "cameras", "ground"),
    *("training", "truth", "topics", "labels", "frames"),
    *("output.record", "output.focus", "output.labels", "fleet", "run"),
)
def fleet(
    paths: Drives,
    *,
    output: Annotated[
        Path,
        arguments.option(
            "-o --output",
            "Folder of all results; drives that have results there are not replayed again.",
            "FOLDER",
        ),
    ],
    options: OptionValues,
    json: arguments.Json = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Replay many drives and judge them together.

        roadeval fleet drives/ -o all
        roadeval fleet drives/ -o all --variant robust --jobs 4

    The drives are replayed on this machine or on a cluster. The same command again replays only
    what is missing or has changed. A drive that cannot be used has a row with the reason, and
    the exit code is then 3.
    """
    config = arguments.configuration(options)
    from roadeval.cli.screens import fleet as screen
    from roadeval.cli.screens.tables import show_verdict
    from roadeval.jobs.run.fleet import replay_fleet as run

    with progress.show(quiet) as watch:
        outcome = run(paths, output, config, on_progress=watch)
    if json:
        console.emit(outcome.facts.text().rstrip())
    elif not quiet:
        screen.show(outcome, console.results())
    messages.warn_of_missing_loops()
    for sentence in screen.problems(outcome):
        messages.warning(sentence)
    if lines := [*screen.manifest(outcome.facts)]:
        messages.note(
            "labels differ from drive to drive: state `labels` in a manifest, such as drives.toml, "
            "and give the manifest in place of the drives"
        )
        for line in lines:
            console.diagnostics().print(line, soft_wrap=True)
    if not (json or quiet):
        show_verdict(outcome.facts, console.results())
    return ExitCode.LOSS if outcome.lost else ExitCode.DONE
