"""``roadeval compare``: what changed between results, and a guard for a merge."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from roadeval.cli import arguments, console, messages
from roadeval.cli.exit_codes import ExitCode


def _condition(texts: list[str] | None) -> list[str] | None:
    from roadeval.evaluation.conditions import Condition

    with arguments.usage():
        for text in texts or ():
            Condition.parse(text)
    return texts


def _ending(paths: list[Path] | None) -> list[Path] | None:
    for path in paths or ():
        if path.suffix.lower() not in (".pdf", ".md", ".json"):
            raise typer.BadParameter(f"{path}: end it in .pdf, .md or .json")
    return paths


Results = Annotated[
    list[Path],
    typer.Argument(
        metavar="BASE NEW...",
        show_default=False,
        help="Recordings or results folders; of a single one its variants are compared.",
    ),
]
Variants = Annotated[
    list[str] | None,
    typer.Option(
        "--variant",
        metavar="NAME",
        help="Only this one; of a single result the first is the base. Repeatable.",
    ),
]
Conditions = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-if",
        metavar="CONDITION",
        callback=_condition,
        help="As 'post.filtered.ERR > +0.5pp' (change; with 'surely' at the end: its whole "
        "interval) or '> 20%' (level). Repeatable.",
    ),
]
Outputs = Annotated[
    list[Path] | None,
    typer.Option(
        "-o",
        "--output",
        metavar="FILE",
        callback=_ending,
        help="Write it as .pdf, .md or .json, by the ending. Repeatable.",
    ),
]


def compare(
    results: Results,
    *,
    variant: Variants = None,
    fail_if: Conditions = None,
    output: Outputs = None,
    paper: arguments.PaperSize = "a4",
    json: arguments.Json = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Compare results of one drive, or the variants of one result.

    Frame by frame; those that either trained on are left out. Results of different drives are put
    side by side without differences. Exit code 4 if a --fail-if condition holds; 1 if one cannot be
    judged, as where two results have fewer than ten frames in common, or fewer than half of those
    of the shorter one.
    """
    from roadeval.cli.screens import compare as screen
    from roadeval.jobs import compare as comparing
    from roadeval.jobs.outputs import holding

    size = arguments.paper_of(paper)
    with holding(*(output or ()), inputs=results):
        compared = comparing.compare(results, variants=variant, fail_if=fail_if or ())
        for path in output or ():
            comparing.write(compared, path, paper=size)
    if json:
        console.emit(comparing.as_json(compared).rstrip())
    elif not quiet:
        screen.show(compared.content, console.results())
    for warning in compared.content["warnings"]:
        messages.warning(warning)
    for sentence in compared.held:
        messages.error(sentence)
    return ExitCode.CONDITION_HELD if compared.held else ExitCode.DONE


COMMAND: Final = compare
