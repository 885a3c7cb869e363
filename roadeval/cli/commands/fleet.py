"""``roadeval fleet``: many drives in one run, at the terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import Given, takes

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
    *("output.record", "fleet", "run"),
)
def fleet(
    paths: Drives,
    *,
    output: Annotated[
        Path,
        arguments.option(
            "-o --output",
            "Where all results land; what is done there already is not done again.",
            "FOLDER",
        ),
    ],
    given: Given,
    json: arguments.Json = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Replay many drives and judge them together.

    On this machine or a cluster. The folder is the state: the same command again does only what is
    missing or has changed. A drive that cannot be used is a row with the reason, and the exit code
    is 3 then.
    """
    config = arguments.configuration(given)
    from roadeval.cli.screens import fleet as screen
    from roadeval.jobs.run.fleet import replay_fleet as run

    with progress.watched(quiet) as watch:
        found = run(paths, output, config, on_progress=watch)
    if json:
        console.emit(found.facts.text().rstrip())
    elif not quiet:
        screen.show(found, console.results())
    messages.loops_missing()
    for sentence in screen.problems(found):
        messages.warning(sentence)
    return ExitCode.LOSS if found.lost else ExitCode.DONE
