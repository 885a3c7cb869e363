"""``roadeval compare``: what changed between results, and limits that a change must keep."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

from roadeval.cli import arguments, console, messages, progress

Results = Annotated[
    list[str],
    arguments.argument(
        "BASE NEW...",
        "Recordings, results folders, fleets or URLs; a single one has its variants compared.",
    ),
]
Variants = Annotated[
    list[str] | None,
    arguments.option(
        "--variant",
        "Variant to compare; others are left out. a=b compares a of the base with b of the new "
        "result. The first variant of a single result is its base. Repeatable.",
        "NAME|BASE=NEW",
    ),
]
Outputs = Annotated[
    list[Path] | None,
    arguments.option(
        "-o --output",
        "File that ends in .pdf, .html, .md, .json, or .svg (a badge). Repeatable.",
        "FILE",
        callback=arguments.ending_in(".pdf", ".html", ".md", ".json", ".svg"),
    ),
]
Junit = Annotated[
    Path | None,
    arguments.option("--junit", "JUnit XML file with a case for each condition.", "FILE"),
]
Markdown = Annotated[
    Path | None,
    arguments.option("--markdown", "File with the text of one comment on a pull request.", "FILE"),
]


def compare(
    results: Results,
    *,
    variant: Variants = None,
    fail_if: arguments.Conditions = None,
    output: Outputs = None,
    junit: Junit = None,
    markdown: Markdown = None,
    json: arguments.Json = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Compare results, or the variants of one result.

        roadeval compare old.rrd new.rrd
        roadeval compare old.rrd new.rrd --fail-if "post.filtered.ERR > +0.5pp"

    Drives are paired by name or log, and frames by stamp. Frames that trained either result are
    left out. One drive is judged over its frames, several drives are judged over the drives.
    Results of different drives are not compared. Exit code 4 if a --fail-if condition holds; 1 if
    one cannot be judged, for example because two results share fewer than ten frames, or fewer than
    half the frames of the smaller one; 3 if drives of a fleet failed (no number includes them).
    """
    from roadeval.cli.screens import compare as screen
    from roadeval.jobs.outputs import holding
    from roadeval.jobs.results import compare as job
    from roadeval.jobs.results.history import list_results

    options = [f"--variant={name}" for name in variant or ()]
    options += [f"--fail-if={condition}" for condition in fail_if or ()]
    command = shlex.join(["roadeval", "compare", *map(str, results), *options])
    files = [(path, "") for path in output or ()]
    files += [(path, kind) for path, kind in ((junit, "junit"), (markdown, "comment")) if path]
    listing = list_results(results)
    with holding(*(path for path, _ in files), inputs=listing.paths):
        with progress.show(quiet or json) as watch:
            compared = job.compare(
                listing, variants=variant, fail_if=fail_if or [], on_progress=watch
            )
        for path, kind in files:
            job.write(compared, path, kind, command)
    if json:
        console.emit(job.as_json(compared).rstrip())
    elif not quiet:
        screen.show(compared.comparison, compared.judgements, console.results())
    for warning in compared.comparison.warnings:
        if warning not in compared.lost:
            messages.warning(warning)
    if not (json or quiet):
        screen.show_verdict(compared.comparison, console.results())
    lost = messages.losses(compared.lost)
    return messages.conditions(compared.judgements) or lost
