"""``roadeval compare``: what changed between results, and a guard for a merge."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from roadeval.cli import arguments, console, messages
from roadeval.cli.commands.report import inspect_command
from roadeval.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from rich.console import Console

    from roadeval.report.pdf.typeset import Paper


def _ending(paths: list[Path] | None) -> list[Path] | None:
    for path in paths or ():
        if path.suffix.lower() not in (".pdf", ".html", ".md", ".json"):
            raise typer.BadParameter(f"{path}: end it in .pdf, .html, .md or .json")
    return paths


Results = Annotated[
    list[Path],
    typer.Argument(
        metavar="BASE NEW...",
        show_default=False,
        help="Recordings or results folders; of a single one its variants are compared. Or two "
        "fleets.",
        readable=False,
    ),
]
Variants = Annotated[
    list[str] | None,
    typer.Option(
        "--variant",
        metavar="NAME|BASE'S=NEW'S",
        help="Only this one; of a single result the first is the base. Of two results, one may be "
        "held against another: a=b. Repeatable.",
    ),
]
Outputs = Annotated[
    list[Path] | None,
    typer.Option(
        "-o",
        "--output",
        metavar="FILE",
        callback=_ending,
        help="Write it as .pdf, .html, .md or .json, by the ending. Repeatable.",
        readable=False,
    ),
]


def compare(
    results: Results,
    *,
    variant: Variants = None,
    fail_if: arguments.Conditions = None,
    output: Outputs = None,
    paper: arguments.PaperSize = "a4",
    json: arguments.Json = False,
    quiet: arguments.Quiet = False,
) -> int:
    """Compare results of one drive, a result's variants, or two fleets.

    Frame by frame; those that either trained on are left out. Results of different drives are put
    side by side without differences. Exit code 4 if a --fail-if condition holds; 1 if one cannot be
    judged, as where two results have fewer than ten frames in common, or fewer than half of those
    of the shorter one. Fleets are paired by drive, and judged over drives.
    """
    from roadeval.jobs.outputs import holding
    from roadeval.results.fleet.kind import are_fleets

    size = arguments.paper_of(paper)
    told = _fleets if are_fleets(results) else _results
    with holding(*(output or ()), inputs=results):
        shown = told(results, variant, fail_if or [], output or [], size)
    if json:
        console.emit(shown.json().rstrip())
    elif not quiet:
        shown.show(shown.content, console.results())
    for warning in shown.content["warnings"]:
        messages.warning(warning)
    for sentence in shown.held:
        messages.error(sentence)
    return ExitCode.CONDITION_HELD if shown.held else ExitCode.DONE


@dataclass(frozen=True, slots=True)
class _Shown:
    """A comparison, whatever of: its content, conditions that hold, and how it is shown."""

    content: Mapping[str, Any]
    held: Sequence[str]
    json: Callable[[], str]
    show: Callable[[Mapping[str, Any], Console], None]


def _results(
    results: list[Path],
    variants: list[str] | None,
    conditions: list[str],
    outputs: list[Path],
    paper: Paper,
) -> _Shown:
    from roadeval.cli.screens import compare as screen
    from roadeval.jobs import compare as comparing

    compared = comparing.compare(results, variants=variants, fail_if=conditions)
    for path in outputs:
        comparing.write(compared, path, paper=paper, inspect=inspect_command)
    return _Shown(compared.content, compared.held, lambda: comparing.as_json(compared), screen.show)


def _fleets(
    results: list[Path],
    variants: list[str] | None,
    conditions: list[str],
    outputs: list[Path],
    paper: Paper,
) -> _Shown:
    from roadeval.cli.screens import compare_fleets as screen
    from roadeval.jobs import compare_fleets as comparing

    base, new = results
    compared = comparing.compare_fleets(base, new, variants=variants, fail_if=conditions)
    for path in outputs:
        comparing.write(compared, path, paper=paper)
    return _Shown(compared.content, compared.held, lambda: comparing.as_json(compared), screen.show)


COMMAND: Final = compare
