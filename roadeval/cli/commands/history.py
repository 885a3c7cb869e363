"""``roadeval history``: which rates got worse, and since when."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from roadeval.cli import arguments, console, messages, progress
from roadeval.cli.arguments import argument, option


def history(
    results: Annotated[
        list[str],
        argument("RESULT...|FOLDER", "Results of many runs, or folders with results below."),
    ],
    *,
    by: Annotated[
        str | None,
        option("--by", "Name of a --label: results with the same value are one run.", "NAME"),
    ] = None,
    last: Annotated[
        int,
        option(
            "--last", "Earlier runs; --fail-if compares the last run with their mean.", "N", min=1
        ),
    ] = 7,
    fail_if: arguments.Conditions = None,
    output: Annotated[
        list[Path] | None,
        option(
            "-o --output",
            "File of the history that ends in .html, .pdf, .md or .json. Repeatable.",
            "FILE",
            callback=arguments.ending_in(".html", ".pdf", ".md", ".json"),
        ),
    ] = None,
    json: arguments.Json = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Show which rates got worse over many runs, and since when.

        roadeval history nightly/
        roadeval history nightly/ --last 10 -o history.html

    Runs are in the order in which they were made. Drives are paired: an added or removed drive
    changes nothing, and a drive with another truth counts as a new one. In a year of nightly runs
    the chance of any false step is at most 5 %. Exit code 4 if a --fail-if condition holds for the
    last run against the mean of the --last runs before it; 1 if it cannot be judged; 3 if a result
    cannot be read.
    """
    from roadeval.cli.screens import history as screen
    from roadeval.jobs.outputs import holding
    from roadeval.jobs.results import history as job

    listing = job.list_results(results)
    with holding(*(output or ()), inputs=listing.paths):
        with progress.show(quiet or json) as watch:
            made = job.history(listing, by=by, last=last, fail_if=fail_if or [], on_progress=watch)
        for path in output or []:
            job.write(made, path)
    if json:
        console.emit(job.as_json(made).rstrip())
    elif not quiet:
        screen.show(made, console.results())
    lost = messages.losses(made.lost)
    return messages.conditions(made.judgements) or lost
